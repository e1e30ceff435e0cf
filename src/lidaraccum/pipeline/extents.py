"""How large a mover is, and the box that goes along with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.pipeline.courses import turned, way
from lidaraccum.pipeline.freespace import SightedFrame

LONGEST_M = 25.0
WIDEST_M = 4.0
"""Nothing on a road is longer, no vehicle is wider."""

BOX_MARGIN_M = 0.3
"""So far outside a mover's box, or its strip, nothing is its own."""

WHOLE_QUANTILES = (0.005, 0.995)
"""A mover is at least as long and wide as these of its points, of all frames put together."""

PASSING_M = 0.3
"""A mover is at a place while it goes its length and this much more."""

SKEW_RAD = np.deg2rad(np.arange(-35, 36, 5))
ENDS = (0.01, 0.99)
"""A vehicle in a bend lies askew to its way, by one of these. Its width lies between these
quantiles of its points."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Where a mover is at a time, and how it goes on.

    Attributes:
        velocity: (3,) m/s, world, at the stamp.
        centre: (3,) metres, world, of some of its points at the stamp.
        stamp: Seconds.
        turn: Radians a second.
    """

    velocity: NDArray[np.float64]
    centre: NDArray[np.float64]
    stamp: float
    turn: float = 0.0


@dataclass(frozen=True, eq=False)
class Course:
    """A mover's level coordinates at one time: along its way and to the left of it.

    Attributes:
        here: (2,) metres, world: where its centre is.
        axes: (2, 2) columns: unit vectors along and to the left.
    """

    here: NDArray[np.float64]
    axes: NDArray[np.float64]

    @classmethod
    def at(cls, motion: Motion, stamp: float) -> Course:
        """Where a motion has come to by then."""
        seconds = stamp - motion.stamp
        ahead = turned(motion.velocity, motion.turn * seconds)[:2]
        ahead = ahead / np.linalg.norm(ahead)
        axes = np.array([ahead, [-ahead[1], ahead[0]]]).T
        here = motion.centre + way(motion.velocity, motion.turn, seconds)
        return cls(here[:2], axes)

    def places(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (N, 3), world, along and to the left (N, 2), metres: what goes along stays."""
        return np.asarray((points[:, :2] - self.here) @ self.axes)


@dataclass(frozen=True, eq=False)
class Box:
    """A level box that goes along with a mover.

    Attributes:
        course: Where the mover is.
        low: (2,) metres along and to the left.
        high: (2,) as well.
    """

    course: Course
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def along_way(
    picked: Mapping[int, NDArray[np.int64]],
    motion: Motion,
    frames: Sequence[SightedFrame],
) -> tuple[list[SightedFrame], list[Course], list[NDArray[np.float64]]]:
    """The frames that show a mover, where it is in each, and places (K, 2) of its points there."""
    shown = [frame for frame in frames if len(picked.get(frame.index, ()))]
    courses = [Course.at(motion, frame.stamp) for frame in shown]
    places = [
        course.places(frame.world(picked[frame.index]))
        for frame, course in zip(shown, courses, strict=True)
    ]
    return shown, courses, places


def boxes_of(courses: Sequence[Course], places: Sequence[NDArray[np.float64]]) -> list[Box]:
    """Where a mover is in each frame, as large as its places (K, 2) of all frames together tell."""
    low, high = np.quantile(np.concatenate(places), WHOLE_QUANTILES, axis=0)
    return [
        Box(one, np.minimum(low, own.min(axis=0)), np.maximum(high, own.max(axis=0)))
        for one, own in zip(courses, places, strict=True)
    ]


def outside_boxes(
    boxes: Sequence[Box], points: NDArray[np.float64], margin_m: float
) -> NDArray[np.bool_]:
    """(T, N) which points (N, 3), world, are outside each of T boxes, grown by a margin."""
    here, axes, low, high = (
        np.stack(one)
        for one in zip(*((b.course.here, b.course.axes, b.low, b.high) for b in boxes), strict=True)
    )
    places = (points[None, :, :2] - here[:, None]) @ axes
    below, above = places < (low - margin_m)[:, None], places > (high + margin_m)[:, None]
    return np.asarray((below | above).any(axis=2))


def length_along(points: NDArray[np.float64], velocity: NDArray[np.float64]) -> float:
    """Metres from end to end of points (N, 3), world, the way a velocity (3,) goes."""
    return float(np.ptp(points[:, :2] @ velocity[:2]) / np.linalg.norm(velocity))


def seconds_at_place(length_m: float, velocity: NDArray[np.float64]) -> float:
    """How long a mover of such a length and velocity (3,) is at a place."""
    return (length_m + PASSING_M) / float(np.linalg.norm(velocity))


def width_across(points: NDArray[np.float64], velocity: NDArray[np.float64]) -> float:
    """Metres from side to side of points (N, 3), world, that go with a velocity (3,), or askew."""
    course = Course.at(Motion(velocity, points.mean(axis=0), 0.0), 0.0)
    return width(course.places(points))


def is_vehicle_sized(points: NDArray[np.float64], velocity: NDArray[np.float64]) -> bool:
    """Whether points (N, 3), world, that go with a velocity (3,), are no more than a vehicle."""
    long, wide = length_along(points, velocity), width_across(points, velocity)
    return long <= LONGEST_M and wide <= WIDEST_M


def width(places: NDArray[np.float64]) -> float:
    """How wide, metres, points at places (N, 2) are across, however askew they may lie."""
    across = places @ np.stack([np.sin(SKEW_RAD), np.cos(SKEW_RAD)])
    low, high = np.quantile(across, ENDS, axis=0)
    return float((high - low).min())
