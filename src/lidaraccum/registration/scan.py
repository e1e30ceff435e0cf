"""A frame made ready for registration: its usable points, deskewed, and a thin choice of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray, Frame
from lidaraccum.geometry import voxel
from lidaraccum.registration.deskew import SweepClock, deskewed
from lidaraccum.registration.settings import RegistrationSettings

StaticMask = Callable[[Frame], BoolArray]
"""Says for each point (N,) of a frame whether registration may use it (movers: False)."""

INDOOR_SHARE = 0.25
"""Where half the points are within four times the near limit, the limit shrinks with them."""


@dataclass(frozen=True, eq=False)
class Scan:
    """One frame on its way through registration.

    Attributes:
        index: Place of the frame in the sequence.
        raw: The frame as read.
        frame: The frame, deskewed where that was called for.
        usable: (N,) bool: points that registration may use.
        source: (M, 3) float64: the thinned usable points that are aligned, sensor coordinates.
    """

    index: int
    raw: Frame
    frame: Frame
    usable: BoolArray
    source: NDArray[np.float64]

    @property
    def points(self) -> NDArray[np.float64]:
        """All usable points (K, 3), sensor coordinates at the stamp."""
        return self.frame.points[self.usable].astype(np.float64)

    @property
    def deskewed(self) -> bool:
        """Whether the points were moved to the stamp."""
        return self.frame is not self.raw


def usable_points(
    frame: Frame, settings: RegistrationSettings, static_mask: StaticMask | None
) -> BoolArray:
    """Points (N,) that came back, are neither the carrying car nor far off, and stand still."""
    usable = frame.returned.copy()
    if not frame.origin.any():
        distance = np.linalg.norm(frame.points, axis=1)
        if usable.any():
            near = INDOOR_SHARE * float(np.median(distance[usable]))
            usable &= distance >= min(settings.min_range_m, near)
        usable &= distance <= settings.max_range_m
    if static_mask is not None:
        usable &= static_mask(frame)
    return usable


def prepare(
    index: int,
    raw: Frame,
    usable: BoolArray,
    motion: tuple[SweepClock, NDArray[np.float64], float],
    source_voxel_m: float,
) -> Scan:
    """Deskew a frame and choose its source points.

    Args:
        index: Place of the frame in the sequence.
        raw: The frame as read.
        usable: (N,) from `usable_points`.
        motion: How time runs within a sweep, the twist (6,) over one frame interval, and that
            interval in seconds.
        source_voxel_m: Edge of the voxels that give one source point each.
    """
    clock, twist, interval_s = motion
    fractions = clock.fractions(raw, interval_s)
    frame = raw if fractions is None else deskewed(raw, twist, fractions)
    points = frame.points[usable]
    source = points[voxel.thin(points, source_voxel_m)].astype(np.float64)
    return Scan(index, raw, frame, usable, source)
