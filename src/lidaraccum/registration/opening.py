"""The first frames, solved together: their motion, their clock, the way that planes leave open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.geometry import rigid
from lidaraccum.registration.along import APART_M, SURE, SteadyMotion
from lidaraccum.registration.deskew import Compensated, SweepClock, TimedSweep
from lidaraccum.registration.passage import Passage
from lidaraccum.registration.quality import ADRIFT
from lidaraccum.registration.scan import Scan
from lidaraccum.registration.sightlines import gain
from lidaraccum.registration.surface_map import SurfaceMap
from lidaraccum.registration.tracker import MAX_ACCELERATION, SMOOTH_M

MAX_OPENING_PASSES = 3
MAX_FREEING_PASSES = 2

UNCLEAR = 1.0
"""Standard deviations by which an unclear motion must be preferred; a clear one by any."""

SETTLED_M, SETTLED_RAD = 0.02, 0.001
"""The first frames are solved again as long as the first motion changes by more."""

CLEARLY_BETTER = 0.98
"""Of two clocks one leaves less than this share of the other's misfit."""

NO_WORSE = 1.0
"""The share where the points say nothing of the clock."""


class Opening:
    """The first frames of a sequence, which pass as often as their motion needs to settle."""

    def __init__(self, passage: Passage, scans: Sequence[Scan]) -> None:
        self._passage = passage
        self._scans = scans

    def solve(self) -> list[RegisteredFrame]:
        """The frames with their poses; the passage stands behind the last of them."""
        if not self._scans:
            return []
        passed = self._solve()
        open_axes = self._passage.tracker.open_axes
        if self._passage.given is None and 2 * len(open_axes) >= len(passed):
            passed = self._freed(passed)
        self._passage.tracker.forget_opening()
        return passed

    def _solve(self) -> list[RegisteredFrame]:
        """Solve the first frames together: once to learn the motion, once more with it."""
        for earlier, later in pairwise(self._scans):
            self._passage.pace.see(earlier.raw.stamp, later.raw.stamp)
        wanted = self._passage.settings.deskew == "auto"
        has_times = wanted and self._scans[0].raw.time_offset is not None
        first_clock: SweepClock = TimedSweep() if has_times else Compensated()
        passed = self._run(first_clock, None)
        if len(passed) < 2:
            return passed
        seen = self._passage.look_at_sweep()
        if has_times and seen is None:
            return self._better(passed, first_clock, Compensated(), NO_WORSE)
        clock = seen or first_clock
        if clock == first_clock == Compensated():
            return passed if self._is_steady(passed) else self._tried_again(passed)
        if clock != first_clock and has_times:
            return self._better(passed, first_clock, clock, CLEARLY_BETTER)
        return self._settled(passed, clock)

    def _better(
        self, passed: list[RegisteredFrame], timed: SweepClock, seeming: SweepClock, share: float
    ) -> list[RegisteredFrame]:
        """The first frames by the file's times where these fit better than what seems so.

        Equal steps of azimuth are seen from the sensor's place only, and on one sensor's beams:
        points in a vehicle's coordinates look as if compensated, two stacked sensors tell nothing.
        The misfit must be less than a share of that without the times.
        """
        by_times = self._settled(passed, timed)
        hoped, misfit = self._passage.tracker.judge.first, self._misfit()
        without = self._settled(passed, seeming)
        if misfit > share * self._misfit():
            return without
        return self._run(timed, self._first_twist(by_times), hoped)

    def _settled(self, passed: list[RegisteredFrame], clock: SweepClock) -> list[RegisteredFrame]:
        """The first frames again and again, from the motion before, until it stays."""
        for _ in range(MAX_OPENING_PASSES):
            twist = self._first_twist(passed)
            passed = self._run(clock, twist, self._passage.tracker.judge.first)
            change = np.abs(self._first_twist(passed) - twist)
            if change[3:].max() < SETTLED_M and change[:3].max() < SETTLED_RAD:
                break
        return passed

    def _tried_again(self, unsteady: list[RegisteredFrame]) -> list[RegisteredFrame]:
        """The first frames once more, from their usual motion; kept where more points fit."""
        again = self._run(Compensated(), self._first_twist(unsteady))
        if _mean_overlap(again) > _mean_overlap(unsteady):
            return again
        return self._run(Compensated(), None)

    def _run(
        self,
        clock: SweepClock,
        twist: NDArray[np.float64] | None,
        hoped: float | None = None,
    ) -> list[RegisteredFrame]:
        self._passage.begin(clock, twist, hoped)
        return [self._passage.place(scan) for scan in self._scans]

    def _freed(self, passed: list[RegisteredFrame]) -> list[RegisteredFrame]:
        """The first frames from the steady motion that sight lines prefer, if they do clearly."""
        passage = self._passage
        reach_m = passage.settings.max_speed_mps * passage.pace.interval_s
        is_clear = True
        for _ in range(MAX_FREEING_PASSES):
            kept, steady = passage.tracker, self._steady_motion(passed)
            before = steady.agreement([one.world_from_sensor for one in passed])
            best = steady.best(reach_m)
            is_clear = best.is_clear
            again = self._ridden(kept.clock, best.poses, steady.axis)
            found = steady.agreement([one.world_from_sensor for one in again])
            # Planes are finer than sight lines, but know only where rings were.
            is_near = abs(step_between(*passed[:2]) - step_between(*again[:2])).max() < APART_M
            enough = SURE if is_near else 0.0 if is_clear else UNCLEAR
            if gain(found, before) <= enough:
                passage.tracker = kept
                break
            passed = self._timed_again(again, best.poses, steady.axis)
        return passed if is_clear else [passed[0], *map(_adrift, passed[1:])]

    def _timed_again(
        self,
        passed: list[RegisteredFrame],
        poses: list[rigid.Pose],
        axis: NDArray[np.float64],
    ) -> list[RegisteredFrame]:
        """The same frames by the clock that their motion, now that it is another, shows."""
        clock = self._passage.look_at_sweep(anew=True)
        if clock is None or clock == self._passage.tracker.clock:
            return passed
        return self._ridden(clock, poses, axis)

    def _ridden(
        self, clock: SweepClock, poses: list[rigid.Pose], axis: NDArray[np.float64]
    ) -> list[RegisteredFrame]:
        """The first frames at steady poses, from the first frame on, moved across an axis only."""
        stamps = [scan.raw.stamp for scan in self._scans]
        twist = rigid.logarithm(poses[1]) / self._passage.pace.steps(stamps[0], stamps[1])
        self._passage.begin(clock, twist)
        passed = [self._passage.place(self._scans[0])]
        first = passed[0].world_from_sensor
        rail = first[:3, :3] @ axis
        for scan, pose in zip(self._scans[1:], poses[1:], strict=True):
            passed.append(self._passage.ride(scan, first @ pose, rail))
        return passed

    def _steady_motion(self, passed: list[RegisteredFrame]) -> SteadyMotion:
        passage = self._passage
        stamps = [one.frame.stamp for one in passed]
        steps = [passage.pace.steps(*pair) for pair in pairwise(stamps)]
        surface = SurfaceMap(passage.settings.voxel_m, passage.settings.max_range_m * 1.1)
        surface.insert(passage.tracker.sights[0].points, now=0)
        # Which way it points may differ, and one frame may err.
        axes = np.stack(passage.tracker.open_axes)
        axis = passed[0].world_from_sensor[:3, :3].T @ np.linalg.eigh(axes.T @ axes)[1][:, 2]
        return SteadyMotion(list(passage.tracker.sights), np.cumsum([0.0, *steps]), surface, axis)

    def _misfit(self) -> float:
        """Metres between points and map, more where fewer points lie on it at all.

        The distances alone are those of points that fit: what fits badly leaves them, and they
        shrink.
        """
        return float(np.mean(self._passage.tracker.misfits))

    def _first_twist(self, passed: list[RegisteredFrame]) -> NDArray[np.float64]:
        """Motion at the first frame: the first step, unless the next ones disagree with it."""
        steps = self._step_twists(passed)
        return steps[0] if self._is_steady(passed) else np.median(steps, axis=0)

    def _is_steady(self, passed: list[RegisteredFrame]) -> bool:
        steps = self._step_twists(passed)
        frames = np.arange(1, len(steps) + 1)
        allowed = SMOOTH_M + MAX_ACCELERATION * self._passage.pace.interval_s**2 * frames
        away = np.linalg.norm(steps[:, 3:] - np.median(steps, axis=0)[3:], axis=1)
        return bool((away < allowed).all())

    def _step_twists(self, passed: list[RegisteredFrame]) -> NDArray[np.float64]:
        poses = [one.world_from_sensor for one in passed]
        return self._passage.pace.twists([one.frame.stamp for one in passed], poses)


def step_between(before: RegisteredFrame, now: RegisteredFrame) -> NDArray[np.float64]:
    """How far (3,) the sensor went, metres, in its coordinates before."""
    return (rigid.invert(before.world_from_sensor) @ now.world_from_sensor)[:3, 3]


def _adrift(frame: RegisteredFrame) -> RegisteredFrame:
    doubts = frame.quality.doubts
    if ADRIFT in doubts:
        return frame
    return replace(frame, quality=replace(frame.quality, doubts=(*doubts, ADRIFT)))


def _mean_overlap(registered: list[RegisteredFrame]) -> float:
    return float(np.mean([one.quality.overlap for one in registered]))
