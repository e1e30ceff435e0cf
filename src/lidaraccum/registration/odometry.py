"""Ego-motion of a whole sequence from points alone, or checked and refined from given poses."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame, RegistrationQuality
from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.registration.deskew import Compensated, SweepClock, TimedSweep
from lidaraccum.registration.icp import assess
from lidaraccum.registration.locate import Hypothesis, Located, proposed, refine, search
from lidaraccum.registration.pace import Pace
from lidaraccum.registration.proposals import Reach
from lidaraccum.registration.quality import Judge
from lidaraccum.registration.scan import Scan, StaticMask, prepare, usable_points
from lidaraccum.registration.settings import RegistrationSettings
from lidaraccum.registration.surface_map import SurfaceMap

logger = logging.getLogger(__name__)

MAX_ACCELERATION = 8.0
"""m/s²: a step that differs from constant velocity by more is compared with its rivals."""

SAME_TWIST_M, SAME_TWIST_RAD = 0.02, 0.0005
"""A frame is deskewed again when its motion turns out to differ by more from what was assumed."""

MAX_PASSES = 3


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
    yield from odometry.open(opening)
    count = len(opening)
    for index, frame in stream:
        count += 1
        yield odometry.follow(index, frame)
    if given is not None and len(given) != count:
        raise InputError(f"there are {len(given)} poses for {count} frames")


class Odometry:
    """The state between frames: the local map, the last pose, the last motion."""

    def __init__(
        self,
        settings: RegistrationSettings,
        given: NDArray[np.float64] | None,
        static_mask: StaticMask | None,
    ) -> None:
        self.settings = settings
        self.given = given
        self.static_mask = static_mask
        self.pace = Pace()
        self.clock: SweepClock = Compensated()
        self._reset()

    def _reset(self) -> None:
        reach = self.settings.max_range_m * 1.1
        self.surface = SurfaceMap(self.settings.voxel_m, reach)
        self.judge = Judge(self.settings)
        self.last: RegisteredFrame | None = None
        self.twist: NDArray[np.float64] | None = None

    def open(self, opening: list[tuple[int, Frame]]) -> list[RegisteredFrame]:
        """Solve the first frames together: once to learn the motion, once more with it."""
        if not opening:
            return []
        for (_, earlier), (_, later) in zip(opening, opening[1:], strict=False):
            self.pace.see(earlier.stamp, later.stamp)
        if self.settings.deskew == "auto" and opening[0][1].time_offset is not None:
            self.clock = TimedSweep()
        first_pass = [self.follow(index, frame) for index, frame in opening]
        if len(opening) < 2 or isinstance(self.clock, Compensated):
            return first_pass
        twist = self._step_twist(first_pass[0], first_pass[1])
        self._reset()
        self.twist = twist
        return [self.follow(index, frame) for index, frame in opening]

    def follow(self, index: int, raw: Frame) -> RegisteredFrame:
        """Register the next frame and add it to the map."""
        usable = usable_points(raw, self.settings, self.static_mask)
        if self.last is None:
            return self._start(index, raw, usable)
        self.pace.see(self.last.frame.stamp, raw.stamp)
        steps = self.pace.steps(self.last.frame.stamp, raw.stamp)
        known = self.twist is not None
        twist = self.twist if self.twist is not None else np.zeros(6)
        predicted = self.last.world_from_sensor @ rigid.exponential(twist * steps)
        if self.given is not None:
            predicted = self._given(index)
        for _ in range(MAX_PASSES):
            scan = self._prepare(index, raw, usable, twist)
            located = self._locate(scan, predicted, steps, known)
            pose = located.alignment.world_from_sensor
            found = rigid.logarithm(rigid.invert(self.last.world_from_sensor) @ pose) / steps
            change = np.abs(found - twist)
            twist, predicted, known = found, pose, True
            if (
                not isinstance(scan.frame, Frame)
                or (change[3:].max() < SAME_TWIST_M and change[:3].max() < SAME_TWIST_RAD)
                or not scan.deskewed
            ):
                break
        return self._accept(scan, located, twist)

    def _start(self, index: int, raw: Frame, usable: NDArray[np.bool_]) -> RegisteredFrame:
        pose = np.eye(4) if self.given is None else self._given(index)
        twist = self.twist if self.twist is not None else np.zeros(6)
        scan = self._prepare(index, raw, usable, twist)
        quality = RegistrationQuality("first", overlap=1.0, residual_m=0.0)
        return self._remember(scan, pose, quality)

    def _prepare(
        self, index: int, raw: Frame, usable: NDArray[np.bool_], twist: NDArray[np.float64]
    ) -> Scan:
        motion = (self.clock, twist, self.pace.interval_s)
        return prepare(index, raw, usable, motion, self.settings.source_voxel_m)

    def _locate(self, scan: Scan, predicted: rigid.Pose, steps: float, known: bool) -> Located:
        if self.given is not None and self.settings.poses_mode == "given":
            return Located("given", assess(self.surface, scan.source, predicted))
        name = "previous" if self.given is None else "given"
        if known or self.given is not None:
            found = refine(self.surface, scan.source, Hypothesis(name, predicted))
            if self.judge.trusts(found) and self._is_smooth(found, predicted, steps):
                return found
        assert self.last is not None
        still = self.last.world_from_sensor
        interval = steps * self.pace.interval_s
        reach = Reach(
            min(self.settings.max_speed_mps * interval, 60.0),
            min(np.deg2rad(self.settings.max_turn_dps) * interval, np.pi),
        )
        axes = (2,) if known else (2, 0, 1)
        starts = [Hypothesis(name, predicted), Hypothesis("still", still)]
        starts += proposed(self.surface, scan.source, predicted, reach, axes)
        return search(self.surface, scan.source, starts)

    def _is_smooth(self, found: Located, predicted: rigid.Pose, steps: float) -> bool:
        interval = steps * self.pace.interval_s
        away = found.alignment.world_from_sensor[:3, 3] - predicted[:3, 3]
        return bool(np.linalg.norm(away) < 0.2 + MAX_ACCELERATION * interval**2)

    def _accept(self, scan: Scan, located: Located, twist: NDArray[np.float64]) -> RegisteredFrame:
        quality = self.judge.judge(located)
        pose = located.alignment.world_from_sensor
        self.twist = twist
        return self._remember(scan, pose, quality)

    def _remember(
        self, scan: Scan, pose: rigid.Pose, quality: RegistrationQuality
    ) -> RegisteredFrame:
        self.surface.insert(rigid.transform(pose, scan.points), scan.index)
        self.surface.forget_far(pose[:3, 3], scan.index)
        registered = RegisteredFrame(scan.index, scan.frame, pose, quality, scan.deskewed)
        # Only the stamp and the pose are needed of it: let go of the points.
        self.last = replace(registered, frame=Frame(np.zeros((0, 3), np.float32), scan.raw.stamp))
        return registered

    def _given(self, index: int) -> rigid.Pose:
        assert self.given is not None
        if index >= len(self.given):
            raise InputError(f"there are {len(self.given)} poses, too few for the frames")
        return self.given[index]

    def _step_twist(self, one: RegisteredFrame, two: RegisteredFrame) -> NDArray[np.float64]:
        steps = self.pace.steps(one.frame.stamp, two.frame.stamp)
        between = rigid.invert(one.world_from_sensor) @ two.world_from_sensor
        return rigid.logarithm(between) / steps
