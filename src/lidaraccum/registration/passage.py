"""Frames on their way onto the map, one after another, and what they tell of the sweep's clock."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.registration.azimuth_time import Glimpse
from lidaraccum.registration.deskew import Compensated, SweepClock
from lidaraccum.registration.locate import Hypothesis
from lidaraccum.registration.pace import Pace
from lidaraccum.registration.scan import Scan
from lidaraccum.registration.settings import RegistrationSettings
from lidaraccum.registration.sweep import SweepDetector
from lidaraccum.registration.tracker import Tracker

WINDOW = 5
"""Frames looked at together for the motion within a sweep."""

LATE_CLOCK = (
    "motion within the sweep is undone from here on, which may move the pose by a part of it"
)

LATE_MOTION_M = 0.4
"""Motion per frame from which on a clock that is found late is worth a doubt."""


class Passage:
    """A sequence on its way onto the map; the first frames may pass several times.

    Attributes:
        settings: What registration may be told.
        given: (T, 4, 4) world_from_sensor for each frame, or None.
        pace: How stamps follow one another.
        tracker: The map and the last pose on it; may be put back to an earlier pass's.
    """

    def __init__(
        self,
        settings: RegistrationSettings,
        given: NDArray[np.float64] | None,
    ) -> None:
        self.settings = settings
        self.given = given
        self.pace = Pace()
        self.tracker = Tracker(settings, self.pace, Compensated())
        self._detector = SweepDetector(settings)
        self._recent: deque[tuple[Frame, Glimpse]] = deque(maxlen=WINDOW)
        self._last: tuple[int, rigid.Pose] | None = None
        self._stamp: float | None = None
        self._clock_is_new = False

    def begin(
        self,
        clock: SweepClock,
        twist: NDArray[np.float64] | None,
        hoped: float | None = None,
    ) -> None:
        """Start with an empty map, from a motion (6,) over one frame interval or from none.

        Where the second frame, so started, reaches most of a hoped score, no other motion is tried.
        """
        self.tracker = Tracker(self.settings, self.pace, clock, twist, hoped)
        self._last = self._stamp = None
        self._recent.clear()

    def follow(self, scan: Scan) -> RegisteredFrame:
        """Register the next frame of the stream and add it to the map."""
        if self._stamp is not None:
            self.pace.see(self._stamp, scan.raw.stamp)
        registered = self.place(scan)
        if self._clock_is_new:
            quality = registered.quality
            doubts = (*quality.doubts, LATE_CLOCK)
            registered = replace(registered, quality=replace(quality, doubts=doubts))
            self._clock_is_new = False
        if not self._detector.done and len(self._recent) == WINDOW:
            clock = self.look_at_sweep()
            self._recent.clear()
            if clock is not None and clock != self.tracker.clock:
                self.tracker.clock = clock
                self._clock_is_new = self._is_fast()
        return registered

    def place(self, scan: Scan) -> RegisteredFrame:
        """Put a frame on the map, the first one after `begin` where it says the map begins."""
        pose = None if self.given is None else self._given_pose(scan.index)
        if self._last is None:
            registered = self.tracker.start(scan, np.eye(4) if pose is None else pose)
        elif pose is None:
            registered = self.tracker.follow(scan)
        elif self.settings.poses_mode == "given":
            registered = self.tracker.hold(scan, pose)
        else:
            before, world_from_before = self._last
            step = rigid.invert(self._given_pose(before)) @ pose
            hints = (Hypothesis("given", world_from_before @ step), Hypothesis("given", pose))
            registered = self.tracker.follow(scan, hints)
        self._note(scan, registered)
        return registered

    def ride(self, scan: Scan, pose: rigid.Pose, rail: NDArray[np.float64]) -> RegisteredFrame:
        """Put a frame at a pose, moved across a rail (3,), world, only."""
        registered = self.tracker.ride(scan, pose, rail)
        self._note(scan, registered)
        return registered

    def look_at_sweep(self, *, anew: bool = False) -> SweepClock | None:
        """The clock that the last frames show; ``anew``: whatever was decided before."""
        if anew:
            self._detector = SweepDetector(self.settings)
        if self._detector.done or len(self._recent) < 2:
            return None
        frames, seen = zip(*self._recent, strict=True)
        poses = [one.world_from_sensor for one in seen]
        twists = self.pace.twists([frame.stamp for frame in frames], poses)
        before, after = np.vstack([twists[:1], twists]), np.vstack([twists, twists[-1:]])
        glimpses = [
            replace(one, twist=twist) for one, twist in zip(seen, (before + after) / 2, strict=True)
        ]
        return self._detector.look(frames, glimpses, self.pace.interval_s)

    def _is_fast(self) -> bool:
        twist = self.tracker.twist
        return twist is not None and bool(np.linalg.norm(twist[3:]) > LATE_MOTION_M)

    def _note(self, scan: Scan, registered: RegisteredFrame) -> None:
        self._last = scan.index, registered.world_from_sensor
        self._stamp = scan.raw.stamp
        if not self._detector.done:
            few, pose = scan.source(np.zeros(6)), registered.world_from_sensor
            self._recent.append((scan.raw, Glimpse(scan.usable_points, few, pose, np.zeros(6))))

    def _given_pose(self, index: int) -> rigid.Pose:
        assert self.given is not None
        if index >= len(self.given):
            raise InputError(f"there are only {len(self.given)} poses for more frames")
        return self.given[index]
