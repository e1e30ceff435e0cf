"""Ego-motion of a whole sequence from points alone, or from given poses, checked or refined."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray, Frame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.registration.along import APART_M, SURE, SteadyMotion
from lidaraccum.registration.azimuth_time import Glimpse
from lidaraccum.registration.deskew import Compensated, SweepClock, TimedSweep
from lidaraccum.registration.locate import Hypothesis
from lidaraccum.registration.pace import Pace
from lidaraccum.registration.quality import ADRIFT
from lidaraccum.registration.scan import StaticMask, usable_points
from lidaraccum.registration.settings import RegistrationSettings
from lidaraccum.registration.sightlines import gain
from lidaraccum.registration.surface_map import SurfaceMap
from lidaraccum.registration.sweep import SweepDetector
from lidaraccum.registration.tracker import (
    CONTRADICTION_M,
    MAX_ACCELERATION,
    SMOOTH_M,
    Tracker,
)

CLEARLY_MORE = 0.05
"""Poses are contradicted by others only where so much more of the points fits."""

WINDOW = 5
"""Frames looked at together for the motion within a sweep."""

MAX_OPENING_PASSES = 3
MAX_FREEING_PASSES = 2

UNCLEAR = 1.0
"""Standard deviations by which an unclear motion must be preferred; a clear one by any."""

SETTLED_M, SETTLED_RAD = 0.02, 0.001
"""The first frames are solved again as long as the first motion changes by more."""

CLEARLY_BETTER = 0.96
"""Of two clocks one leaves less than this share of the other's distances to the map."""

NO_WORSE = 1.0
"""The share where the points say nothing of the clock."""

LATE_CLOCK = (
    "motion within the sweep is undone from here on, which may move the pose by a part of it"
)

LATE_MOTION_M = 0.4
"""Motion per frame from which on a clock that is found late is worth a doubt."""

Indexed = tuple[int, Frame]


def register(
    frames: Iterable[Frame],
    settings: RegistrationSettings | None = None,
    given: NDArray[np.float64] | None = None,
    static_mask: StaticMask | None = None,
) -> Iterator[RegisteredFrame]:
    """Find where the sensor was in every frame.

    Frames leave in order, each exactly once, all its points in order; the first few leave together,
    after the motion they started with is known. Memory does not grow with the sequence.

    Args:
        frames: In order; at least one.
        settings: What registration may be told; defaults when None.
        given: (T, 4, 4) world_from_sensor for each frame, used as ``settings.poses_mode`` says.
        static_mask: Says which points of a frame (N,) registration may use.

    Yields:
        Frames with world_from_sensor at their stamps. The world is frame 0's sensor coordinates
        (less its origin, where frames are georeferenced), or that of the given poses.

    Raises:
        InputError: Fewer or more given poses than frames.
    """
    settings = settings or RegistrationSettings()
    stream = iter(enumerate(frames))
    opening = list(islice(stream, settings.lookahead))
    odometry = Odometry(settings, given, static_mask)
    opened = odometry.open(opening)
    if given is not None and settings.poses_mode == "given":
        # Poses of another drive, inverted or all identity show in the first steps already.
        free = Odometry(settings, None, static_mask).open(opening)
        opened = compared(opened, free)
    yield from opened
    count = len(opening)
    del opening
    for index, frame in stream:
        count += 1
        yield odometry.follow(index, frame)
    if given is not None and len(given) != count:
        raise InputError(f"there are {len(given)} poses for {count} frames")


def compared(held: list[RegisteredFrame], free: list[RegisteredFrame]) -> list[RegisteredFrame]:
    """Frames at their given poses, doubted where the points alone say another step."""
    frames = held[:1]
    for (held_before, held_now), (free_before, free_now) in zip(
        pairwise(held), pairwise(free), strict=True
    ):
        given_m = _step(held_before, held_now)
        found_m = _step(free_before, free_now)
        away_m = float(np.linalg.norm(given_m - found_m))
        clearer = free_now.quality.overlap > held_now.quality.overlap + CLEARLY_MORE
        if away_m < CONTRADICTION_M or free_now.quality.doubts or not clearer:
            frames.append(held_now)
            continue
        contradiction = f"the points say a step {away_m:.1f} m other than the given poses"
        quality = replace(held_now.quality, doubts=(*held_now.quality.doubts, contradiction))
        frames.append(replace(held_now, quality=quality))
    return frames


def _step(before: RegisteredFrame, now: RegisteredFrame) -> NDArray[np.float64]:
    return (rigid.invert(before.world_from_sensor) @ now.world_from_sensor)[:3, 3]


class Odometry:
    """A sequence on its way through registration."""

    def __init__(
        self,
        settings: RegistrationSettings,
        given: NDArray[np.float64] | None,
        static_mask: StaticMask | None,
    ) -> None:
        self._settings = settings
        self._given = given
        self._static_mask = static_mask
        self._pace = Pace()
        self._detector = SweepDetector(settings)
        self._recent: deque[tuple[Frame, Glimpse]] = deque(maxlen=WINDOW)
        self._last: tuple[int, rigid.Pose] | None = None
        self._stamp: float | None = None
        self._clock_is_new = False
        self._tracker = Tracker(settings, self._pace, Compensated())

    def open(self, opening: list[Indexed]) -> list[RegisteredFrame]:
        """Solve the first frames together, and again where planes leave their motion open."""
        if not opening:
            return []
        passed = self._open(opening)
        if self._given is None and 2 * len(self._tracker.open_axes) >= len(passed):
            return self._freed(opening, passed)
        return passed

    def _freed(
        self, opening: list[Indexed], passed: list[RegisteredFrame]
    ) -> list[RegisteredFrame]:
        """The first frames from the steady motion that sight lines prefer, if they do clearly."""
        reach_m = self._settings.max_speed_mps * self._pace.interval_s
        is_clear = True
        for _ in range(MAX_FREEING_PASSES):
            kept, steady = self._tracker, self._steady_motion(passed)
            before = steady.agreement([one.world_from_sensor for one in passed])
            best = steady.best(reach_m)
            is_clear = best.is_clear
            again = self._ridden(opening, kept.clock, best.poses, steady.axis)
            found = steady.agreement([one.world_from_sensor for one in again])
            # Planes are finer than sight lines, but know only where rings were.
            is_near = abs(_step(*passed[:2]) - _step(*again[:2])).max() < APART_M
            enough = SURE if is_near else 0.0 if is_clear else UNCLEAR
            if gain(found, before) <= enough:
                self._tracker = kept
                break
            passed = self._timed_again(opening, again, best.poses, steady.axis)
        return passed if is_clear else [passed[0], *map(_adrift, passed[1:])]

    def _timed_again(
        self,
        opening: list[Indexed],
        passed: list[RegisteredFrame],
        poses: list[rigid.Pose],
        axis: NDArray[np.float64],
    ) -> list[RegisteredFrame]:
        """The same frames by the clock that their motion, now that it is another, shows."""
        self._detector = SweepDetector(self._settings)
        clock = self._look_at_sweep() if self._settings.deskew == "auto" else None
        if clock is None or clock == self._tracker.clock:
            return passed
        return self._ridden(opening, clock, poses, axis)

    def _ridden(
        self,
        opening: list[Indexed],
        clock: SweepClock,
        poses: list[rigid.Pose],
        axis: NDArray[np.float64],
    ) -> list[RegisteredFrame]:
        """The first frames at steady poses, from the first frame on, moved across an axis only."""
        stamps = [frame.stamp for _, frame in opening]
        twist = rigid.logarithm(poses[1]) / self._pace.steps(stamps[0], stamps[1])
        self._begin(clock, twist)
        frames = [self._place(*opening[0])]
        first = frames[0].world_from_sensor
        rail = first[:3, :3] @ axis
        for (index, raw), pose in zip(opening[1:], poses[1:], strict=True):
            usable = usable_points(raw, self._settings, self._static_mask)
            frames.append(self._tracker.ride(index, raw, usable, first @ pose, rail))
            self._note(index, raw, usable, frames[-1])
        return frames

    def _steady_motion(self, passed: list[RegisteredFrame]) -> SteadyMotion:
        sights = list(self._tracker.sights)[: len(passed)]
        stamps = [one.frame.stamp for one in passed]
        steps = [self._pace.steps(*pair) for pair in pairwise(stamps)]
        surface = SurfaceMap(self._settings.voxel_m, self._settings.max_range_m * 1.1)
        surface.insert(sights[0].points, now=0)
        # Which way it points may differ, and one frame may err.
        axes = np.stack(self._tracker.open_axes)
        axis = passed[0].world_from_sensor[:3, :3].T @ np.linalg.eigh(axes.T @ axes)[1][:, 2]
        return SteadyMotion(sights, np.cumsum([0.0, *steps]), surface, axis)

    def _open(self, opening: list[Indexed]) -> list[RegisteredFrame]:
        """Solve the first frames together: once to learn the motion, once more with it."""
        for (_, earlier), (_, later) in pairwise(opening):
            self._pace.see(earlier.stamp, later.stamp)
        has_times = self._settings.deskew == "auto" and opening[0][1].time_offset is not None
        first_clock: SweepClock = TimedSweep() if has_times else Compensated()
        passed = self._run(opening, first_clock, None)
        if len(passed) < 2:
            return passed
        seen = self._look_at_sweep()
        if has_times and seen is None:
            return self._better(opening, passed, first_clock, Compensated(), NO_WORSE)
        clock = seen or first_clock
        if clock == first_clock == Compensated():
            return passed if self._is_steady(passed) else self._tried_again(opening, passed)
        if clock != first_clock and has_times:
            return self._better(opening, passed, first_clock, clock, CLEARLY_BETTER)
        return self._settled(opening, passed, clock)

    def _better(
        self,
        opening: list[Indexed],
        passed: list[RegisteredFrame],
        timed: SweepClock,
        seeming: SweepClock,
        share: float,
    ) -> list[RegisteredFrame]:
        """The first frames by the file's times where these fit better than what seems so.

        Equal steps of azimuth are seen from the sensor's place only, and on one sensor's beams:
        points in a vehicle's coordinates look as if compensated, two stacked sensors tell nothing.
        Distances to the map must be less than a share of those without the times.
        """
        by_times = self._settled(opening, passed, timed)
        without = self._settled(opening, passed, seeming)
        if _mean_residual(by_times) > share * _mean_residual(without):
            return without
        return self._run(opening, timed, self._opening_twist(by_times))

    def _settled(
        self, opening: list[Indexed], passed: list[RegisteredFrame], clock: SweepClock
    ) -> list[RegisteredFrame]:
        """The first frames again and again, from the motion before, until it stays."""
        for _ in range(MAX_OPENING_PASSES):
            twist = self._opening_twist(passed)
            passed = self._run(opening, clock, twist)
            change = np.abs(self._opening_twist(passed) - twist)
            if change[3:].max() < SETTLED_M and change[:3].max() < SETTLED_RAD:
                break
        return passed

    def _tried_again(
        self, opening: list[Indexed], unsteady: list[RegisteredFrame]
    ) -> list[RegisteredFrame]:
        """The first frames once more, from their usual motion; kept where more points fit."""
        again = self._run(opening, Compensated(), self._opening_twist(unsteady))
        if _mean_overlap(again) > _mean_overlap(unsteady):
            return again
        return self._run(opening, Compensated(), None)

    def follow(self, index: int, raw: Frame) -> RegisteredFrame:
        """Register the next frame and add it to the map."""
        if self._stamp is not None:
            self._pace.see(self._stamp, raw.stamp)
        registered = self._place(index, raw)
        if self._clock_is_new:
            quality = registered.quality
            doubts = (*quality.doubts, LATE_CLOCK)
            registered = replace(registered, quality=replace(quality, doubts=doubts))
            self._clock_is_new = False
        if not self._detector.done and len(self._recent) == WINDOW:
            clock = self._look_at_sweep()
            self._recent.clear()
            if clock is not None and clock != self._tracker.clock:
                self._tracker.clock = clock
                self._clock_is_new = self._is_fast()
        return registered

    def _is_fast(self) -> bool:
        twist = self._tracker.twist
        return twist is not None and bool(np.linalg.norm(twist[3:]) > LATE_MOTION_M)

    def _run(
        self, opening: list[Indexed], clock: SweepClock, twist: NDArray[np.float64] | None
    ) -> list[RegisteredFrame]:
        self._begin(clock, twist)
        return [self._place(index, frame) for index, frame in opening]

    def _begin(self, clock: SweepClock, twist: NDArray[np.float64] | None) -> None:
        self._tracker = Tracker(self._settings, self._pace, clock, twist)
        self._last = self._stamp = None
        self._recent.clear()

    def _place(self, index: int, raw: Frame) -> RegisteredFrame:
        usable = usable_points(raw, self._settings, self._static_mask)
        pose = None if self._given is None else self._given_pose(index)
        if self._last is None:
            registered = self._tracker.start(
                index, raw, usable, np.eye(4) if pose is None else pose
            )
        elif pose is None:
            registered = self._tracker.follow(index, raw, usable)
        elif self._settings.poses_mode == "given":
            registered = self._tracker.hold(index, raw, usable, pose)
        else:
            before, world_from_before = self._last
            step = rigid.invert(self._given_pose(before)) @ pose
            hints = (Hypothesis("given", world_from_before @ step), Hypothesis("given", pose))
            registered = self._tracker.follow(index, raw, usable, hints)
        self._note(index, raw, usable, registered)
        return registered

    def _note(self, index: int, raw: Frame, usable: BoolArray, registered: RegisteredFrame) -> None:
        self._last = index, registered.world_from_sensor
        self._stamp = raw.stamp
        if not self._detector.done:
            points = raw.points[usable].astype(np.float64)
            self._recent.append((raw, Glimpse(points, registered.world_from_sensor, np.zeros(6))))

    def _look_at_sweep(self) -> SweepClock | None:
        if self._detector.done or len(self._recent) < 2:
            return None
        frames, seen = zip(*self._recent, strict=True)
        twists = _steps_between(self._pace, [frame.stamp for frame in frames], seen)
        before, after = np.vstack([twists[:1], twists]), np.vstack([twists, twists[-1:]])
        glimpses = [
            replace(one, twist=twist) for one, twist in zip(seen, (before + after) / 2, strict=True)
        ]
        return self._detector.look(frames, glimpses, self._pace.interval_s)

    def _given_pose(self, index: int) -> rigid.Pose:
        assert self._given is not None
        if index >= len(self._given):
            raise InputError(f"there are only {len(self._given)} poses for more frames")
        return self._given[index]

    def _opening_twist(self, passed: list[RegisteredFrame]) -> NDArray[np.float64]:
        """Motion at the first frame: the first step, unless the next ones disagree with it."""
        steps = self._step_twists(passed)
        return steps[0] if self._is_steady(passed) else np.median(steps, axis=0)

    def _is_steady(self, passed: list[RegisteredFrame]) -> bool:
        steps = self._step_twists(passed)
        frames = np.arange(1, len(steps) + 1)
        allowed = SMOOTH_M + MAX_ACCELERATION * self._pace.interval_s**2 * frames
        away = np.linalg.norm(steps[:, 3:] - np.median(steps, axis=0)[3:], axis=1)
        return bool((away < allowed).all())

    def _step_twists(self, passed: list[RegisteredFrame]) -> NDArray[np.float64]:
        return _steps_between(self._pace, [one.frame.stamp for one in passed], passed)


def _adrift(frame: RegisteredFrame) -> RegisteredFrame:
    doubts = frame.quality.doubts
    if ADRIFT in doubts:
        return frame
    return replace(frame, quality=replace(frame.quality, doubts=(*doubts, ADRIFT)))


def _steps_between(
    pace: Pace, stamps: Sequence[float], placed: Sequence[RegisteredFrame | Glimpse]
) -> NDArray[np.float64]:
    """Motion (T - 1, 6) over one frame interval from each of consecutive frames to the next."""
    twists = []
    for (earlier, one), (later, two) in pairwise(zip(stamps, placed, strict=True)):
        between = rigid.invert(one.world_from_sensor) @ two.world_from_sensor
        twists.append(rigid.logarithm(between) / pace.steps(earlier, later))
    return np.stack(twists)


def _mean_residual(registered: list[RegisteredFrame]) -> float:
    """Of all frames but the first, which has nothing to lie on."""
    return float(np.mean([one.quality.residual_m for one in registered[1:]]))


def _mean_overlap(registered: list[RegisteredFrame]) -> float:
    return float(np.mean([one.quality.overlap for one in registered]))
