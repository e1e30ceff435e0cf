"""Laws of a mover's own motion within a sweep: undone where it is known, left alone where not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from lidaraccum.data.accumulation import BACKGROUND, MOVING
from lidaraccum.data.frame import Frame
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.data.registered import RegisteredFrame, RegistrationQuality
from lidaraccum.data.window import Window
from lidaraccum.geometry import rigid
from lidaraccum.pipeline.accumulator import AccumulateSettings, Accumulator
from lidaraccum.pipeline.mover_deskew import undo_own_motion
from lidaraccum.pipeline.perception import GivenLabels
from lidaraccum.registration.odometry import register
from lidaraccum.registration.settings import RegistrationSettings
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.settings import DriveSettings

CAR, POINTS, STILL_POINTS, INTERVAL_S, FASTEST_MPS = 7, 200, 50, 0.1, 35.0
BUSY = DriveSettings(
    seed=4, frames=2, sensor="VLP-16", rate_hz=10.0, scene="crossing", speed_mps=9.0,
    rolling_shutter=True, compensated=False, coordinates="sensor", zeros=False, exact=True,
)  # fmt: skip
STILL = np.random.default_rng(9).uniform(-20, 20, (STILL_POINTS, 3)).astype(np.float32)


@cache
def busy(compensated: bool) -> Window:
    return Window(simulate(replace(BUSY, compensated=compensated)), 0, BUSY.frames)


@dataclass(frozen=True)
class Road:
    """A car that turns as it goes, seen by a sensor that goes too; the truth at any time.

    Attributes:
        rate: (6,) the car's twist per second, its own axes.
        late_s: When, after the stamp, the sweep passes the middle of the car, by frame.
        fitted: Poses are those of the points as they lie, not those at the stamp.
    """

    rate: tuple[float, ...] = (0.0, 0.0, 0.4, 14.0, 0.0, 0.0)
    late_s: tuple[float, ...] = (0.02, -0.03, 0.01, 0.04)
    fitted: bool = False

    def sensor(self, index: int) -> rigid.Pose:
        return rigid.exponential(np.array([0.0, 0.0, 0.01, 0.9, 0.0, 0.0]) * index)

    def car(self, seconds: float) -> rigid.Pose:
        start = rigid.translation((8.0, 3.0, 1.0))
        return start @ rigid.exponential(np.array(self.rate) * seconds)

    def body(self, index: int) -> np.ndarray:
        """(K, 3) what a frame sees of the car, in its own coordinates."""
        return np.random.default_rng(index).uniform([-2, -0.9, -0.7], [2, 0.9, 0.7], (POINTS, 3))

    def seconds(self, index: int) -> np.ndarray:
        """(N,) when each point is measured, after the stamp; the car's centred on `late_s`."""
        spread = np.linspace(-0.004, 0.004, POINTS) + self.late_s[index]
        return np.concatenate([np.full(STILL_POINTS, 0.03), spread]).astype(np.float32)

    def at_stamp(self, index: int) -> np.ndarray:
        """(K, 3) where the car's points are at the frame's stamp, sensor coordinates."""
        sensor_from_world = rigid.invert(self.sensor(index))
        return rigid.transform(sensor_from_world @ self.car(index * INTERVAL_S), self.body(index))

    def frame(self, index: int) -> PerceivedFrame:
        stamp, seconds = index * INTERVAL_S, self.seconds(index)
        sensor_from_world = rigid.invert(self.sensor(index))
        measured = [
            rigid.transform(sensor_from_world @ self.car(stamp + late), point[None])
            for late, point in zip(seconds[STILL_POINTS:].tolist(), self.body(index), strict=True)
        ]
        registered = RegisteredFrame(
            index,
            Frame(np.concatenate([STILL, *measured]).astype(np.float32), stamp=stamp),
            self.sensor(index),
            RegistrationQuality("given", 1.0, 0.0),
            seconds_from_stamp=seconds,
        )
        own = np.arange(len(seconds)) >= STILL_POINTS
        return PerceivedFrame(
            registered,
            np.where(own, MOVING, BACKGROUND).astype(np.uint8),
            np.where(own, CAR, 0).astype(np.int32),
            np.ones(len(seconds), np.float32),
            {CAR: self.car(stamp + (self.late_s[index] if self.fitted else 0.0))},
            poses_at_stamp=not self.fitted,
        )

    def frames(self) -> list[PerceivedFrame]:
        return [self.frame(index) for index in range(len(self.late_s))]


def points(frame: PerceivedFrame) -> np.ndarray:
    return frame.registered.frame.points


def undone(frames: list[PerceivedFrame]) -> list[PerceivedFrame]:
    return list(undo_own_motion(frames, FASTEST_MPS))


@pytest.mark.parametrize("fitted", [False, True], ids=["poses at stamp", "poses fitted"])
def test_a_mover_is_where_it_was_at_the_stamp(fitted: bool) -> None:
    road = Road(fitted=fitted)
    frames = road.frames()
    for index, (before, after) in enumerate(zip(frames, undone(frames), strict=True)):
        truth = road.at_stamp(index)
        assert np.linalg.norm(points(before)[STILL_POINTS:] - truth, axis=1).max() > 0.1
        np.testing.assert_allclose(points(after)[STILL_POINTS:], truth, atol=2e-3)
        at_stamp = road.car(index * INTERVAL_S)
        np.testing.assert_allclose(after.world_from_object[CAR], at_stamp, atol=1e-3)


@pytest.mark.parametrize("fitted", [False, True], ids=["poses at stamp", "poses fitted"])
def test_its_points_of_all_frames_fill_one_sharp_body(fitted: bool) -> None:
    road = Road(fitted=fitted)
    for index, frame in enumerate(undone(road.frames())):
        object_from_world = rigid.invert(frame.world_from_object[CAR])
        own = rigid.transform(object_from_world @ road.sensor(index), points(frame)[STILL_POINTS:])
        np.testing.assert_allclose(own, road.body(index), atol=2e-3)


def test_what_stands_is_not_touched_nor_reordered() -> None:
    for frame in undone(Road().frames()):
        np.testing.assert_array_equal(points(frame)[:STILL_POINTS], STILL)
        assert (frame.instance[STILL_POINTS:] == CAR).all()


def test_without_time_per_point_nothing_changes() -> None:
    frames = [
        replace(one, registered=replace(one.registered, seconds_from_stamp=None))
        for one in Road().frames()
    ]
    assert all(one is other for one, other in zip(undone(frames), frames, strict=True))


def test_times_longer_than_a_sweep_are_not_believed() -> None:
    frames = Road(late_s=(0.0, 0.3, 0.0)).frames()
    np.testing.assert_array_equal(points(undone(frames)[1]), points(frames[1]))


def test_a_mover_seen_once_stays_as_it_was() -> None:
    alone = [
        one if index == 1 else replace(one, world_from_object={})
        for index, one in enumerate(Road().frames())
    ]
    np.testing.assert_array_equal(points(undone(alone)[1]), points(alone[1]))


@pytest.mark.parametrize(
    "rate", [(0.0, 0.0, 0.0, 40.0, 0.0, 0.0), (0.0, 0.0, 3.0, 5.0, 0.0, 0.0)], ids=["fast", "spins"]
)
def test_what_no_mover_does_is_refused(rate: tuple[float, ...]) -> None:
    frames = Road(rate).frames()
    for before, after in zip(frames, undone(frames), strict=True):
        np.testing.assert_array_equal(points(after), points(before))


def test_a_mover_seen_at_one_time_by_two_sweeps_tells_no_speed() -> None:
    """At the end of one sweep and at the start of the next."""
    frames = Road(late_s=(0.05, -0.04), fitted=True).frames()
    for before, after in zip(frames, undone(frames), strict=True):
        np.testing.assert_array_equal(points(after), points(before))


def test_one_frame_ahead_is_looked_at_and_no_more() -> None:
    taken = 0

    def counted() -> Iterator[PerceivedFrame]:
        nonlocal taken
        for frame in Road().frames():
            taken += 1
            yield frame

    for given, _ in enumerate(undo_own_motion(counted(), FASTEST_MPS), start=1):
        assert taken == min(given + 1, 4)


@pytest.mark.parametrize("compensated", [False, True], ids=["as measured", "compensated"])
def test_of_a_rolling_shutter_only_the_registration_s_error_remains(compensated: bool) -> None:
    drive = busy(compensated)
    labels = [drive.labels(index) for index in range(len(drive))]
    given = np.stack([one.world_from_sensor for one in labels])
    smeared = list(GivenLabels(drive).perceive(register(drive, RegistrationSettings(), given)))
    errors: list[list[np.ndarray]] = []
    for frames in (smeared, undone(smeared)):
        away = [
            np.linalg.norm(points(frame) - truth.points_at_stamp, axis=1)
            for frame, truth in zip(frames, labels, strict=True)
        ]
        errors.append(away)
    moving = np.concatenate([truth.dynamic & (truth.instance > 0) for truth in labels])
    before, after = (np.concatenate(away) for away in errors)
    assert moving.sum() > 100
    assert before[moving].mean() > 0.05
    assert after[moving].mean() < before[~moving].mean() + 0.02
    np.testing.assert_array_equal(after[~moving], before[~moving])


def test_accumulating_undoes_it_unless_deskewing_is_off() -> None:
    drive = busy(compensated=False)
    at_stamp = drive.labels(0).points_at_stamp
    assert at_stamp is not None
    moving = drive.labels(0).dynamic & (drive.labels(0).instance > 0)
    away = {}
    for deskew in ("auto", "off"):
        settings = AccumulateSettings("oracle", registration=RegistrationSettings(deskew=deskew))
        placed = next(iter(Accumulator(drive, settings).frames()))
        away[deskew] = np.linalg.norm(placed.points - at_stamp, axis=1)[moving]
        np.testing.assert_array_equal(placed.rows, np.arange(len(at_stamp)))
    assert away["auto"].mean() < 0.5 * away["off"].mean()
