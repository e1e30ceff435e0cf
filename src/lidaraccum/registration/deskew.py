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

    def fractions(self, frame: Frame, interval_s: float) -> NDArray[Any] | None:
        """Time (N,) of each point from the stamp, in frame intervals; None: no motion inside."""


@dataclass(frozen=True)
class Compensated:
    """All points of a sweep hold at one time already, or nothing tells otherwise."""

    def fractions(self, frame: Frame, interval_s: float) -> NDArray[Any] | None:
        """None: there is nothing to undo."""
        return None


@dataclass(frozen=True)
class TimedSweep:
    """The file says when each point was measured."""

    def fractions(self, frame: Frame, interval_s: float) -> NDArray[Any] | None:
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

    def fractions(self, frame: Frame, interval_s: float) -> NDArray[Any] | None:
        """Turn of each point from the middle of the sweep, times duration over interval."""
        share = min(self.duration_s / interval_s, 1.0)
        return share * turn_fractions(frame.points, self.seam)


def turn_fractions(points: NDArray[Any], seam: Seam) -> NDArray[Any]:
    """Part of the turn (N,), -0.5..0.5, at which a spinning sensor looked at points (N, 3)."""
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    turn = (azimuth - seam.azimuth_rad) * (seam.direction / (2 * np.pi))
    return np.asarray(turn - np.floor(turn) - 0.5)


def transform_along(
    twist: NDArray[np.float64], fractions: NDArray[Any], points: NDArray[Any]
) -> NDArray[Any]:
    """Move each point (N, 3) by its own part (N,) of a constant twist (6,).

    The series of SE(3)'s exponential, in the points' own precision, to its end: a sweep turns
    little, so that is three terms or four, each cheaper than the sine of a hundred thousand angles.
    """
    columns = np.ascontiguousarray(points.T)
    fractions = fractions.astype(columns.dtype)
    x, y, z = twist[:3]
    turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]], dtype=columns.dtype)
    velocity = twist[3:, None].astype(columns.dtype)
    angle = float(np.linalg.norm(twist[:3]) * np.abs(fractions).max(initial=0.0))
    moved = columns
    for term in range(_terms(angle, float(np.finfo(columns.dtype).eps)), 0, -1):
        shift = np.einsum("ij,jn->in", turn, moved)
        shift += velocity
        shift *= fractions / term
        moved = np.add(columns, shift, out=shift)
    return np.stack(tuple(moved), axis=1)


def _terms(angle: float, least: float) -> int:
    """Terms of the exponential's series at an angle, radians, beyond which none exceeds least."""
    term, size = 1, angle
    while size > least:
        term += 1
        size *= angle / term
    return max(term - 1, 1)


def deskewed(frame: Frame, twist: NDArray[np.float64], fractions: NDArray[Any]) -> Frame:
    """The frame with every returned point where it was at the stamp.

    Args:
        frame: As measured.
        twist: (6,) motion of the sensor over one frame interval, in its own axes.
        fractions: (N,) time of each point from the stamp, in intervals.
    """
    points = transform_along(twist, fractions, frame.points)
    lost = np.flatnonzero(~frame.returned)
    points[lost] = frame.points[lost]
    return frame.with_points(points)
