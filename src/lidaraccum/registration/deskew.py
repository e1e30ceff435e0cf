"""Undoing the sensor's own motion within a sweep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.registration.firing import Seam


class SweepClock(Protocol):
    """When each point of a frame was measured."""

    def fractions(self, frame: Frame, interval_s: float) -> NDArray[np.float64] | None:
        """Time (N,) of each point from the stamp, in frame intervals; None: no motion inside."""


@dataclass(frozen=True)
class Compensated:
    """All points of a sweep hold at one time already, or nothing tells otherwise."""

    def fractions(self, frame: Frame, interval_s: float) -> NDArray[np.float64] | None:
        """None: there is nothing to undo."""
        return None


@dataclass(frozen=True)
class TimedSweep:
    """The file says when each point was measured."""

    def fractions(self, frame: Frame, interval_s: float) -> NDArray[np.float64] | None:
        """Per-point time over the interval; the pose belongs to the stamp."""
        if frame.time_offset is None:
            return None
        return np.asarray(frame.time_offset, dtype=np.float64) / interval_s


@dataclass(frozen=True)
class RotatingSweep:
    """A spinning sensor without times: the azimuth is the clock.

    The stamp is taken to be the middle of the sweep, so an error in the sweep's length does not
    shift the pose.

    Attributes:
        seam: Where a sweep starts and which way it turns.
        duration_s: Seconds a full turn takes.
    """

    seam: Seam
    duration_s: float

    def fractions(self, frame: Frame, interval_s: float) -> NDArray[np.float64] | None:
        """Turn of each point from the middle of the sweep, times duration over interval."""
        share = min(self.duration_s / interval_s, 1.0)
        return share * turn_fractions(frame.points, self.seam)


def turn_fractions(points: NDArray[Any], seam: Seam) -> NDArray[np.float64]:
    """Part of the turn (N,), -0.5..0.5, at which a spinning sensor looked at points (N, 3)."""
    azimuth = np.arctan2(points[:, 1], points[:, 0]).astype(np.float64)
    return np.mod(seam.direction * (azimuth - seam.azimuth_rad) / (2 * np.pi), 1.0) - 0.5


def transform_along(
    twist: NDArray[np.float64], fractions: NDArray[np.float64], points: NDArray[Any]
) -> NDArray[np.float64]:
    """Move each point (N, 3) by its own part (N,) of a constant twist (6,); exact on SE(3).

    Rodrigues' formula about one axis, column by column: a frame has a hundred thousand points.
    """
    rate = float(np.linalg.norm(twist[:3]))
    velocity = twist[3:]
    if rate < 1e-9:
        return points + fractions[:, None] * velocity
    a, b, c = axis = twist[:3] / rate
    x, y, z = np.ascontiguousarray(np.asarray(points, dtype=np.float64).T)
    angle = rate * fractions
    sine, versine = np.sin(angle), 1.0 - np.cos(angle)
    across_x, across_y, across_z = b * z - c * y, c * x - a * z, a * y - b * x
    drift = np.cross(axis, velocity)
    inward_drift = np.cross(axis, drift)
    late = (angle - sine) / rate
    moved = np.empty((len(fractions), 3))
    inward = (
        b * across_z - c * across_y,
        c * across_x - a * across_z,
        a * across_y - b * across_x,
    )
    for k, (place, across) in enumerate(((x, across_x), (y, across_y), (z, across_z))):
        turned = place + sine * across + versine * (inward[k] + drift[k] / rate)
        moved[:, k] = turned + fractions * velocity[k] + late * inward_drift[k]
    return moved


def deskewed(frame: Frame, twist: NDArray[np.float64], fractions: NDArray[np.float64]) -> Frame:
    """The frame with every returned point where it was at the stamp.

    Args:
        frame: As measured.
        twist: (6,) motion of the sensor over one frame interval, in its own axes.
        fractions: (N,) time of each point from the stamp, in intervals.
    """
    points = transform_along(twist, fractions, frame.points).astype(np.float32)
    points[~frame.returned] = frame.points[~frame.returned]
    return frame.with_points(points)
