"""A frame made ready for registration: its usable points, deskewed, and a thin choice of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray, Frame
from lidaraccum.geometry import voxel
from lidaraccum.geometry.order import middle
from lidaraccum.registration.deskew import SweepClock, deskewed, transform_along
from lidaraccum.registration.pace import DEFAULT_INTERVAL_S
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
        usable: (N,) bool: points that registration may use.
        rows: (M,) int64: the thin choice of them that is aligned.
        dense_rows: (L,) int64: the dense choice that has the last word.
        fractions: (N,) time of each point from the stamp in frame intervals; None: no motion
            inside the sweep.
        interval_s: Seconds of a frame interval.
    """

    index: int
    raw: Frame
    usable: BoolArray
    rows: NDArray[np.int64]
    dense_rows: NDArray[np.int64]
    fractions: NDArray[Any] | None = None
    interval_s: float = DEFAULT_INTERVAL_S

    def timed(self, clock: SweepClock, interval_s: float) -> Scan:
        """The same with the time of each point, as a clock tells it."""
        fractions = clock.fractions(self.raw, interval_s)
        return replace(self, fractions=fractions, interval_s=interval_s)

    def source(self, twist: NDArray[np.float64]) -> NDArray[np.float64]:
        """The chosen points (M, 3) at the stamp, had the sensor moved by ``twist`` (6,)."""
        return self._at_stamp(self.rows, twist)

    def dense_source(self, twist: NDArray[np.float64]) -> NDArray[np.float64]:
        """Likewise of the dense choice (L, 3)."""
        return self._at_stamp(self.dense_rows, twist)

    def _at_stamp(self, rows: NDArray[np.int64], twist: NDArray[np.float64]) -> NDArray[np.float64]:
        points = self.raw.points.take(rows, axis=0).astype(np.float64)
        if self.fractions is None:
            return points
        return transform_along(twist, self.fractions[rows], points)

    def straightened(self, twist: NDArray[np.float64]) -> Frame:
        """The whole frame at the stamp, had the sensor moved by ``twist`` (6,)."""
        if self.fractions is None:
            return self.raw
        return deskewed(self.raw, twist, self.fractions)

    @property
    def usable_points(self) -> NDArray[np.float32]:
        """(K, 3) points that registration may use, as measured."""
        return self.raw.points.take(np.flatnonzero(self.usable), axis=0)

    @property
    def bends(self) -> bool:
        """Whether there is motion inside the sweep to be undone."""
        return self.fractions is not None

    @property
    def seconds_from_stamp(self) -> NDArray[np.float32] | None:
        """When each point (N,) was measured; None where nothing tells.

        Times in the file hold also where the sensor's motion was undone before.
        """
        if self.fractions is not None:
            return (self.fractions * self.interval_s).astype(np.float32, copy=False)
        if self.raw.time_offset is not None:
            return self.raw.time_offset.astype(np.float32)
        return None


def prepare(
    index: int, raw: Frame, settings: RegistrationSettings, static_mask: StaticMask | None
) -> Scan:
    """Choose which of a frame's points registration may use, and which of them it aligns."""
    usable = _usable_points(raw, settings, static_mask)
    candidates = np.flatnonzero(usable)
    dense = candidates[voxel.thin(raw.points.take(candidates, axis=0), settings.dense_voxel_m)]
    thin = dense[voxel.thin(raw.points.take(dense, axis=0), settings.source_voxel_m)]
    return Scan(index, raw, usable, thin, dense)


def _usable_points(
    frame: Frame, settings: RegistrationSettings, static_mask: StaticMask | None
) -> BoolArray:
    """Points (N,) that came back, are neither the carrying car nor far off, and stand still."""
    usable = frame.returned.copy()
    if not frame.origin.any():
        distance = frame.ranges
        if usable.any():
            near = INDOOR_SHARE * middle(distance.compress(usable))
            usable &= distance >= min(settings.min_range_m, near)
        usable &= distance <= settings.max_range_m
    if static_mask is not None:
        usable &= static_mask(frame)
    return usable
