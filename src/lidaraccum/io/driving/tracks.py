"""Tracked boxes, also between the stamps at which somebody drew them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid

Array = NDArray[np.float64]

SPEED_SPAN_S = 0.5
"""Speed is the way over this time: long enough that the jitter of drawn boxes is no motion."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """Where a tracked object is at one stamp.

    Attributes:
        world_from_object: (4, 4): the box's centre and heading.
        size_lwh: (3,) metres.
        speed_mps: Over ground; 0 where nothing tells.
        certain: Drawn at this stamp or between two neighbouring drawn ones, and its speed is known.
            Otherwise it is extrapolated, or bridges stamps at which nobody drew it.
    """

    world_from_object: rigid.Pose
    size_lwh: Array
    speed_mps: float
    certain: bool


@dataclass(frozen=True, eq=False)
class Track:
    """One object as drawn.

    Attributes:
        name: The data set's name for it.
        category: The data set's word for its kind.
        stamps: (K,) increasing seconds.
        size_lwh: (K, 3) metres.
        world_from_object: (K, 4, 4).
    """

    name: str
    category: str
    stamps: Array
    size_lwh: Array
    world_from_object: Array

    def at(self, stamp: float, drawn_at: Array) -> Sighting | None:
        """Where the object is at a stamp, or None where the data set says it is not.

        Place and size are linear between drawn stamps, the rotation takes the shortest arc
        (the paper, section 4: boxes are drawn at every tenth sweep of nuScenes only). Before the
        first and after the last drawn stamp the place goes on, up to the next stamp at which
        somebody looked and drew no box.

        Args:
            stamp: Seconds.
            drawn_at: (A,) increasing: the stamps at which somebody drew the boxes of the log.
        """
        row = int(np.searchsorted(self.stamps, stamp))
        if row < len(self.stamps) and self.stamps[row] == stamp:
            return self._sighting(row, row, stamp, certain=True)
        if 0 < row < len(self.stamps):
            bridged = _inside(drawn_at, self.stamps[row - 1], self.stamps[row])
            return self._sighting(row - 1, row, stamp, certain=not bridged)
        ends = sorted((stamp, float(self.stamps[min(row, len(self.stamps) - 1)])))
        if _inside(drawn_at, *ends) or bool((drawn_at == stamp).any()):
            return None
        last = len(self.stamps) - 1
        low = 0 if row == 0 else max(last - 1, 0)
        return self._sighting(low, min(low + 1, last), stamp, certain=False)

    def speed(self, stamp: float) -> float | None:
        """Metres a second over ground about a stamp, or None for what was drawn only once."""
        first, last = float(self.stamps[0]), float(self.stamps[-1])
        span = min(SPEED_SPAN_S, last - first)
        if span <= 0:
            return None
        start = min(max(stamp - span / 2, first), last - span)
        places = self.world_from_object[:, :3, 3]
        way = [np.diff(np.interp([start, start + span], self.stamps, axis)) for axis in places.T]
        return float(np.linalg.norm(way)) / span

    def _sighting(self, low: int, high: int, stamp: float, *, certain: bool) -> Sighting:
        between = self.stamps[high] - self.stamps[low]
        share = float((stamp - self.stamps[low]) / between) if between > 0 else 0.0
        held = min(max(share, 0.0), 1.0)
        speed = self.speed(stamp)
        return Sighting(
            pose_between(self.world_from_object[low], self.world_from_object[high], share),
            (1 - held) * self.size_lwh[low] + held * self.size_lwh[high],
            speed or 0.0,
            certain and speed is not None,
        )


@dataclass(frozen=True, eq=False)
class DrawnBoxes:
    """All boxes of a log, one a row, in any order.

    Attributes:
        names: M tracks' names.
        categories: M words.
        stamps: (M,) seconds.
        size_lwh: (M, 3) metres.
        world_from_object: (M, 4, 4).
    """

    names: Sequence[str]
    categories: Sequence[str]
    stamps: Array
    size_lwh: Array
    world_from_object: Array

    def __post_init__(self) -> None:
        if not (np.isfinite(self.world_from_object).all() and np.isfinite(self.size_lwh).all()):
            raise InputError("the boxes hold non-finite numbers")

    def tracks(self) -> tuple[Track, ...]:
        """The boxes by object, in the order in which the objects appear."""
        rows: dict[str, list[int]] = {}
        for row in np.argsort(self.stamps, kind="stable").tolist():
            of_track = rows.setdefault(self.names[row], [])
            if not of_track or self.stamps[of_track[-1]] < self.stamps[row]:
                of_track.append(row)
        ordered = sorted(rows.items(), key=lambda item: (self.stamps[item[1][0]], item[0]))
        return tuple(
            Track(
                name,
                self.categories[of_track[0]],
                self.stamps[of_track],
                self.size_lwh[of_track],
                self.world_from_object[of_track],
            )
            for name, of_track in ordered
        )


def pose_between(first: rigid.Pose, second: rigid.Pose, share: float) -> rigid.Pose:
    """The pose (4, 4) a share of the way from one to another.

    The place is linear, the rotation takes the shortest arc at constant rate (slerp). Beyond 0 and
    1 the place goes on and the rotation is held.
    """
    if share == 0.0:
        return first.copy()
    turn = np.zeros(6)
    turn[:3] = rigid.logarithm(rigid.invert(first) @ second)[:3] * min(max(share, 0.0), 1.0)
    pose = first @ rigid.exponential(turn)
    pose[:3, 3] = (1 - share) * first[:3, 3] + share * second[:3, 3]
    return pose


def _inside(stamps: Array, low: float, high: float) -> bool:
    """Whether any of the stamps lies truly between two others."""
    return bool(((stamps > low) & (stamps < high)).any())
