"""One frame after another onto the local map: predict, propose, verify, remember."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame, RegistrationQuality
from lidaraccum.geometry import rigid
from lidaraccum.registration.along import open_axis
from lidaraccum.registration.deskew import SweepClock
from lidaraccum.registration.icp import Alignment, align, assess
from lidaraccum.registration.locate import Hypothesis, Located, proposed, refine, search
from lidaraccum.registration.pace import Pace
from lidaraccum.registration.proposals import Reach
from lidaraccum.registration.quality import Judge
from lidaraccum.registration.scan import Scan
from lidaraccum.registration.settings import RegistrationSettings
from lidaraccum.registration.sightlines import Eye, Sight
from lidaraccum.registration.surface_map import SurfaceMap

MAX_ACCELERATION = 8.0
"""m/s²: a step that differs from constant velocity by more is compared with its rivals."""

SMOOTH_M = 0.2
"""Metres added to that, for noise."""

SAME_TWIST_M, SAME_TWIST_RAD = 0.02, 0.0005
"""A frame is deskewed again when its motion turns out to differ by more from what was assumed."""

MAX_PASSES = 3

LAST_ITERATIONS = 3
"""Of the dense choice of points: the thin one has brought the pose to within its own noise."""

MAX_REACH_M = 60.0

LEAST_OVERLAP = 1e-3
"""Frames of which no more fits than this fit nowhere, whatever is near."""

PATIENCE = 3
"""Frames in a row that may be left out of the map as lost before the map starts anew."""


@dataclass(frozen=True, eq=False)
class Fix:
    """The last frame on the map: its place in the sequence, stamp in s, world_from_sensor."""

    index: int
    stamp: float
    world_from_sensor: rigid.Pose


@dataclass(frozen=True, eq=False)
class Expectation:
    """What is thought of a frame before its points are asked.

    Attributes:
        starts: Poses it may have, the likeliest first.
        steps: Frame intervals since the last frame on the map.
        known: Whether the likeliest rests on a motion that was measured.
    """

    starts: tuple[Hypothesis, ...]
    steps: float
    known: bool


CONTRADICTION_M = 0.3
CONTRADICTION_SHARE = 1.1
"""Points that fit so much better so far from a given pose contradict it."""


class Tracker:
    """The local map, the last pose on it and the last motion."""

    def __init__(
        self,
        settings: RegistrationSettings,
        pace: Pace,
        clock: SweepClock,
        twist: NDArray[np.float64] | None = None,
        hoped: float | None = None,
    ) -> None:
        """Begin with an empty map.

        Args:
            settings: What registration may be told.
            pace: Shared with whoever sees the stamps.
            clock: How time runs within a sweep; may be replaced later.
            twist: (6,) motion over one frame interval at the first frame, or None: unknown.
            hoped: Score that the second frame reached in this motion before, or None.
        """
        self.clock = clock
        self.twist = twist
        self._settings = settings
        self._pace = pace
        self._surface = SurfaceMap(settings.voxel_m, settings.max_range_m * 1.1)
        self.judge = Judge(settings, hoped)
        self._last: Fix | None = None
        self._first_origin = np.zeros(3)
        self._lost = 0
        self._eye = Eye()
        self.sights: list[Sight] = []
        self.open_axes: list[NDArray[np.float64]] = []
        self.misfits: list[float] = []

    def forget_opening(self) -> None:
        """Let go of what only the first frames are solved with."""
        self.sights.clear()
        self.open_axes.clear()
        self.misfits.clear()

    def start(self, scan: Scan, pose: rigid.Pose) -> RegisteredFrame:
        """Put the first frame on the empty map."""
        self._first_origin = scan.raw.origin
        scan = self._timed(scan)
        twist = np.zeros(6) if self.twist is None else self.twist
        quality = RegistrationQuality("first", overlap=1.0, residual_m=0.0)
        return self._remember(scan, twist, pose, quality)

    def hold(self, scan: Scan, pose: rigid.Pose) -> RegisteredFrame:
        """Take a given pose as it is; only measure how well the map speaks for it."""
        scan, steps = self._timed(scan), self._steps_to(scan)
        self.twist = self._twist_to(pose, steps)
        source = scan.source(self.twist)
        located = Located("given", assess(self._surface, source, pose))
        if self._opens(scan):
            self._note_misfit(scan.dense_source(self.twist), pose)
        quality = self.judge.judge(located, self._speed(pose, steps))
        rival = refine(self._surface, source, Hypothesis("given", pose)).alignment
        away_m = float(np.linalg.norm(rival.world_from_sensor[:3, 3] - pose[:3, 3]))
        if away_m > CONTRADICTION_M and rival.score > CONTRADICTION_SHARE * located.alignment.score:
            contradiction = f"the points fit clearly better {away_m:.1f} m from the given pose"
            quality = replace(quality, doubts=(*quality.doubts, contradiction))
        return self._remember(scan, self.twist, pose, quality)

    def ride(self, scan: Scan, pose: rigid.Pose, rail: NDArray[np.float64]) -> RegisteredFrame:
        """Put a frame at a pose, as planes have it but for its place along a rail (3,), world."""
        scan, steps = self._timed(scan), self._steps_to(scan)
        twist = self._twist_to(pose, steps)
        placed = align(self._surface, scan.source(twist), pose, rail=rail)
        located = Located("steady", self._polished(scan, placed, twist, rail), sighted=True)
        placed = located.alignment.world_from_sensor
        self.open_axes.append(rail)
        self.twist = self._twist_to(placed, steps)
        quality = self.judge.judge(located, self._speed(placed, steps))
        return self._remember(scan, self.twist, placed, quality)

    def follow(self, scan: Scan, hints: tuple[Hypothesis, ...] = ()) -> RegisteredFrame:
        """Find the next frame's pose; hints are believed before constant velocity."""
        scan = self._timed(scan)
        expectation = self._expect(scan, hints)
        twist = self._twist_to(expectation.starts[0].world_from_sensor, expectation.steps)
        located = self._locate(scan.source(twist), expectation)
        for _ in range(MAX_PASSES - 1):
            found = self._twist_to(located.alignment.world_from_sensor, expectation.steps)
            if not scan.bends or _are_same(found, twist):
                break
            twist = found
            again = refine(self._surface, scan.source(twist), _start_of(located))
            located = replace(located, alignment=again.alignment)
        pose = located.alignment.world_from_sensor
        located = replace(located, alignment=self._polished(scan, pose, twist))
        self._look_along(scan, located, expectation.steps)
        return self._conclude(scan, located, expectation)

    def _expect(self, scan: Scan, hints: tuple[Hypothesis, ...]) -> Expectation:
        assert self._last is not None
        steps = self._steps_to(scan)
        last = self._last.world_from_sensor
        starts = list(hints)
        if scan.raw.origin.any():
            aligned = rigid.translation(scan.raw.origin - self._first_origin)
            starts.append(Hypothesis("aligned", aligned))
        known = self.twist is not None or bool(starts)
        if self.twist is not None:
            moved_on = last @ rigid.exponential(self.twist * steps)
            starts.append(Hypothesis("previous", moved_on))
        starts.append(Hypothesis("still", last))
        return Expectation(tuple(starts), steps, known)

    def _locate(self, source: NDArray[np.float64], expectation: Expectation) -> Located:
        """The likeliest start if it holds; otherwise the best of all that can be thought of."""
        first, found = expectation.starts[0], None
        if expectation.known:
            found = refine(self._surface, source, first)
            if self.judge.trusts(found) and self._is_smooth(found, first, expectation.steps):
                return found
        interval_s = expectation.steps * self._pace.interval_s
        reach = Reach(
            min(self._settings.max_speed_mps * interval_s, MAX_REACH_M),
            min(np.deg2rad(self._settings.max_turn_dps) * interval_s, np.pi),
        )
        # How the sensor is mounted is unknown until it has moved once.
        axes = (2,) if expectation.known else (2, 0, 1)
        shifts = proposed(self._surface, source, first.world_from_sensor, reach, axes)
        return search(self._surface, source, [*expectation.starts, *shifts], found)

    def _polished(
        self,
        scan: Scan,
        pose: rigid.Pose,
        twist: NDArray[np.float64],
        rail: NDArray[np.float64] | None = None,
    ) -> Alignment:
        """What many more points make of a pose; how good it is, the thin choice says as before."""
        dense = scan.dense_source(twist)
        pose = align(self._surface, dense, pose, iterations=LAST_ITERATIONS, rail=rail)
        if self._opens(scan):
            self._note_misfit(dense, pose)
        return assess(self._surface, scan.source(twist), pose)

    def _note_misfit(self, dense: NDArray[np.float64], pose: rigid.Pose) -> None:
        fit = assess(self._surface, dense, pose)
        self.misfits.append(fit.residual_m / max(fit.overlap, LEAST_OVERLAP))

    def _look_along(self, scan: Scan, located: Located, steps: float) -> None:
        """Note the direction that planes leave open, if they do."""
        if scan.raw.origin.any() or not self._opens(scan):
            return
        pose = located.alignment.world_from_sensor
        axis = open_axis(self._surface, scan.source(self._twist_to(pose, steps)), pose)
        if axis is not None:
            self.open_axes.append(axis)

    def _opens(self, scan: Scan) -> bool:
        """Whether a frame is one of the first, which are solved together."""
        return scan.index < self._settings.lookahead

    def _is_smooth(self, found: Located, start: Hypothesis, steps: float) -> bool:
        interval_s = steps * self._pace.interval_s
        away = found.alignment.world_from_sensor[:3, 3] - start.world_from_sensor[:3, 3]
        return bool(np.linalg.norm(away) < SMOOTH_M + 0.5 * MAX_ACCELERATION * interval_s**2)

    def _conclude(self, scan: Scan, located: Located, expectation: Expectation) -> RegisteredFrame:
        """Believe the answer, or keep the expectation where nothing fits."""
        pose = located.alignment.world_from_sensor
        first = expectation.starts[0]
        is_smooth = not expectation.known or self._is_smooth(located, first, expectation.steps)
        lost = self.judge.is_lost(located, is_smooth=is_smooth)
        quality = self.judge.judge(located, self._speed(pose, expectation.steps))
        self._lost = self._lost + 1 if lost else 0
        if lost:
            pose, quality = first.world_from_sensor, replace(quality, hypothesis=first.name)
        twist = self._twist_to(pose, expectation.steps)
        if not lost:
            self.twist = twist
        elif self._lost <= PATIENCE:
            return self._registered(scan, scan.straightened(twist), pose, quality)
        else:
            self.judge.forget()
        return self._remember(scan, twist, pose, quality)

    def _remember(
        self,
        scan: Scan,
        twist: NDArray[np.float64],
        pose: rigid.Pose,
        quality: RegistrationQuality,
    ) -> RegisteredFrame:
        frame = scan.straightened(twist)
        usable = frame.points.take(np.flatnonzero(scan.usable), axis=0)
        self._surface.insert(usable, scan.index, pose)
        self._last = Fix(scan.index, frame.stamp, pose)
        return self._registered(scan, frame, pose, quality)

    def _registered(
        self, scan: Scan, frame: Frame, pose: rigid.Pose, quality: RegistrationQuality
    ) -> RegisteredFrame:
        if self._opens(scan):
            self.sights.append(Sight(frame, scan.usable, scan.rows, pose, self._eye))
        seconds = None if self._settings.deskew == "off" else scan.seconds_from_stamp
        return RegisteredFrame(
            scan.index,
            frame,
            pose,
            quality,
            deskewed=scan.bends,
            seconds_from_stamp=seconds,
        )

    def _timed(self, scan: Scan) -> Scan:
        return scan.timed(self.clock, self._pace.interval_s)

    def _steps_to(self, scan: Scan) -> float:
        assert self._last is not None
        missed = scan.index - self._last.index
        return self._pace.steps(self._last.stamp, scan.raw.stamp, missed)

    def _twist_to(self, pose: rigid.Pose, steps: float) -> NDArray[np.float64]:
        assert self._last is not None
        return rigid.logarithm(rigid.invert(self._last.world_from_sensor) @ pose) / steps

    def _speed(self, pose: rigid.Pose, steps: float) -> float:
        twist = self._twist_to(pose, steps)
        return float(np.linalg.norm(twist[3:])) / self._pace.interval_s


def _are_same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    change = np.abs(one - other)
    return bool(change[3:].max() < SAME_TWIST_M and change[:3].max() < SAME_TWIST_RAD)


def _start_of(located: Located) -> Hypothesis:
    return Hypothesis(located.hypothesis, located.alignment.world_from_sensor)
