"""How much time passes between frames, from stamps that may be rounded, constant or missing."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from statistics import median

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid

DEFAULT_INTERVAL_S = 0.1
ROUNDING = 0.12
"""Intervals this near to the usual one are taken as it: KITTI rounds its stamps to 10 ms."""

MAX_STEPS = 20.0


class Pace:
    """The usual interval between frames, and how many of it lie between two."""

    def __init__(self) -> None:
        self._intervals: deque[float] = deque(maxlen=9)

    def see(self, earlier_s: float, later_s: float) -> None:
        """Note one interval; stamps that do not advance say nothing."""
        if later_s > earlier_s:
            self._intervals.append(later_s - earlier_s)

    @property
    def interval_s(self) -> float:
        """The usual interval, seconds."""
        return median(self._intervals) if self._intervals else DEFAULT_INTERVAL_S

    def steps(self, earlier_s: float, later_s: float, frames: int = 1) -> float:
        """How many usual intervals lie between two stamps, ``frames`` apart.

        Where stamps do not advance, the frames are counted instead.
        """
        if later_s <= earlier_s:
            return float(frames)
        steps = (later_s - earlier_s) / self.interval_s
        whole = max(round(steps), 1)
        return float(whole) if abs(steps - whole) <= ROUNDING * whole else min(steps, MAX_STEPS)

    def twists(self, stamps: Sequence[float], poses: Sequence[rigid.Pose]) -> NDArray[np.float64]:
        """Motion (T - 1, 6) over one interval from each of T poses, world_from_sensor, to the next.

        Args:
            stamps: T, seconds.
            poses: T.
        """
        twists = []
        for (earlier, one), (later, two) in pairwise(zip(stamps, poses, strict=True)):
            between = rigid.invert(one) @ two
            twists.append(rigid.logarithm(between) / self.steps(earlier, later))
        return np.stack(twists)
