"""The network proposes, the points decide: right weights find more, wrong ones move nothing."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.accumulation import BACKGROUND, MOVING, STILL
from lidaraccum.data.frame import Frame
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.geometry import rigid
from lidaraccum.model.network import build_network
from lidaraccum.model.reader import NetworkReader
from lidaraccum.model.reading import FrameReading, ObjectReading, WindowReading
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.pipeline.label_free import LabelFree
from lidaraccum.pipeline.network_led import NetworkLed

PARKED = (((6, 5, 0.2), (10, 6.8, 1.6)), ((14, 5, 0.2), (18.2, 6.8, 1.5)))
"""Where the street's parked cars stand."""


@dataclass(frozen=True)
class Oracle:
    """Stands in for the network and says the truth about a street with movers."""

    street: Any
    movers: Sequence[Any]
    weights: str = "oracle"

    def read(self, frame: Frame) -> Frame:
        return frame

    def look(
        self, encoded: Sequence[Frame], world_from_sensor: np.ndarray, target: int
    ) -> WindowReading:
        pairs = zip(encoded, world_from_sensor, strict=True)
        readings = [self._say(frame, pose, encoded[target].stamp) for frame, pose in pairs]
        return WindowReading(tuple(readings), target, (list(encoded), world_from_sensor))

    def _say(self, frame: Frame, world_from_sensor: np.ndarray, then: float) -> FrameReading:
        world = rigid.transform(world_from_sensor, frame.points)
        on = self._on(frame)
        goal = world[:, :2].copy()
        movable = on > 0
        for low, high in PARKED:
            inside = ((world > np.array(low) - 0.1) & (world < np.array(high) + 0.1)).all(axis=1)
            movable |= inside
            goal[inside] = (np.array(low) + high)[:2] / 2
        for number, mover in enumerate(self.movers, start=1):
            goal[on == number] = (mover.place(then) + np.array(mover.size) / 2)[:2]
        return FrameReading(
            movable.astype(np.float32),
            (on > 0).astype(np.float32),
            (goal - world[:, :2]).astype(np.float32),
        )

    def track(self, reading: WindowReading, instances: Sequence[np.ndarray]) -> ObjectReading:
        frames, poses = reading.kept
        ids = np.unique(np.concatenate([one[one > 0] for one in instances]))
        seen = np.array([[bool((one == name).any()) for one in instances] for name in ids])
        anchor = seen.argmax(axis=1)
        motions = np.tile(np.eye(4), (len(ids), len(frames), 1, 1))
        for row, name in enumerate(ids):
            on = [
                self._on(frame)[own == name] for frame, own in zip(frames, instances, strict=True)
            ]
            mover = self.movers[int(np.bincount(np.concatenate(on)).argmax()) - 1]
            for place, frame in enumerate(frames):
                shift = mover.place(frames[anchor[row]].stamp) - mover.place(frame.stamp)
                motions[row, place] = (
                    rigid.invert(poses[reading.target])
                    @ rigid.translation(shift)
                    @ poses[reading.target]
                )
        return ObjectReading(ids, anchor, seen, motions)

    def _on(self, frame: Frame) -> np.ndarray:
        stamps = [registered.frame.stamp for registered in self.street.frames]
        return np.asarray(self.street.on[stamps.index(frame.stamp)])


@dataclass(frozen=True)
class Liar:
    """Is sure that everything moves, together with whatever is near, at a speed of its own."""

    speed_mps: float
    weights: str = "liar"

    def read(self, frame: Frame) -> Frame:
        return frame

    def look(
        self, encoded: Sequence[Frame], world_from_sensor: np.ndarray, target: int
    ) -> WindowReading:
        rng = np.random.default_rng(0)
        readings = []
        for frame in encoded:
            sure = np.ones(len(frame), dtype=np.float32)
            offset = rng.normal(0, 0.3, (len(frame), 2)).astype(np.float32)
            readings.append(FrameReading(sure, sure, offset))
        return WindowReading(tuple(readings), target, [frame.stamp for frame in encoded])

    def track(self, reading: WindowReading, instances: Sequence[np.ndarray]) -> ObjectReading:
        stamps = np.array(reading.kept)
        ids = np.unique(np.concatenate([one[one > 0] for one in instances]))
        motions = np.tile(np.eye(4), (len(ids), len(stamps), 1, 1))
        motions[:, :, 0, 3] = self.speed_mps * (stamps[0] - stamps)
        seen = np.ones((len(ids), len(stamps)), dtype=np.bool_)
        return ObjectReading(ids, np.zeros(len(ids), dtype=np.int64), seen, motions)


def perceive(street: Any, reader: Any) -> list[PerceivedFrame]:
    return list(NetworkLed(reader).perceive(street.frames))


def moved_share(frames: Sequence[PerceivedFrame], on: Sequence[np.ndarray]) -> float:
    """Of the points that stand."""
    said = np.concatenate([frame.label == MOVING for frame in frames])
    stands = np.concatenate(on) == 0
    return float((said & stands).sum() / stands.sum())


@pytest.fixture(scope="module")
def fresh() -> NetworkReader:
    """Fresh weights that take nearly everything for movable."""
    settings = NetworkSettings(
        extent_m=32.0, base_widths=(16, 24, 32), motion_widths=(32, 48), ego_pillars=64
    )
    network = build_network(settings, seed=3)
    network.foreground_head[2].bias.data.fill_(-0.9)
    for head in (network.point_head.foreground, network.point_head.dynamic):
        head.bias.data.fill_(0.2)
    return NetworkReader(network)


def test_fresh_weights_move_nothing_that_stands(look: Any, fresh: NetworkReader) -> None:
    street = look(noise=0.03)
    frames = perceive(street, fresh)
    assert any((frame.label == STILL).any() for frame in frames), "nothing was proposed"
    assert moved_share(frames, street.on) <= 0.005
    for before, frame in zip(street.frames, frames, strict=True):
        assert frame.registered.world_from_sensor is before.world_from_sensor


@pytest.mark.parametrize("speed", [0.7, -2.0, 6.0])
def test_sure_and_wrong_weights_move_nothing_that_stands(look: Any, speed: float) -> None:
    street = look(noise=0.03)
    assert moved_share(perceive(street, Liar(speed)), street.on) <= 0.005


@pytest.mark.parametrize("speed", [3.0, -8.0])
def test_a_liar_takes_no_mover_away(busy_street: Any, speed: float) -> None:
    alone = [frame.label == MOVING for frame in LabelFree().perceive(busy_street.frames)]
    frames = perceive(busy_street, Liar(speed))
    led = np.concatenate([frame.label == MOVING for frame in frames])
    assert led[np.concatenate(alone)].mean() > 0.9
    assert moved_share(frames, busy_street.on) <= 0.005


def test_a_silent_network_changes_nothing(busy_street: Any) -> None:
    class Silent(Liar):
        def look(
            self, encoded: Sequence[Frame], world_from_sensor: np.ndarray, target: int
        ) -> WindowReading:
            readings = tuple(FrameReading.background(len(frame)) for frame in encoded)
            return WindowReading(readings, target)

    alone = list(LabelFree().perceive(busy_street.frames))
    for frame, again in zip(alone, perceive(busy_street, Silent(0.0)), strict=True):
        assert (frame.label == again.label).all()
        assert (frame.instance == again.instance).all()
        assert (frame.confidence == again.confidence).all()
        assert frame.world_from_object.keys() == again.world_from_object.keys()


def test_movers_that_free_space_alone_misses_are_found(look: Any, new_mover: Any) -> None:
    """A walker along a wall: in half a second nobody sees through where he was."""
    walker = new_mover(low=(12.0, -11.6, 0.0), size=(0.5, 0.5, 1.75), velocity=(-1.2, 0.0, 0.0))
    street = look([walker], count=5)
    on = np.concatenate(street.on) == 1
    alone = np.concatenate([f.label == MOVING for f in LabelFree().perceive(street.frames)])
    frames = perceive(street, Oracle(street, [walker]))
    led = np.concatenate([frame.label == MOVING for frame in frames])
    assert alone[on].mean() < 0.2
    assert led[on].mean() > 0.9
    assert moved_share(frames, street.on) < 0.001
    (mover,) = {name for frame in frames for name in frame.world_from_object}
    first, last = frames[0].world_from_object[mover], frames[-1].world_from_object[mover]
    np.testing.assert_allclose(last[:3, 3] - first[:3, 3], [-0.48, 0, 0], atol=0.1)


def test_what_stands_is_named_once_for_the_whole_drive(look: Any) -> None:
    street = look(count=16)
    frames = perceive(street, Oracle(street, []))
    names: list[set[int]] = [set(), set()]
    for frame, registered in zip(frames, street.frames, strict=True):
        world = rigid.transform(registered.world_from_sensor, registered.frame.points)
        for number, (low, high) in enumerate(PARKED):
            inside = ((world > np.array(low)) & (world < np.array(high) + 0.05)).all(axis=1)
            inside &= world[:, 2] > 0.3
            if inside.sum() > 30:
                assert (frame.label[inside] == STILL).mean() > 0.95
                assert (frame.confidence[inside] > 0.5).all()
                names[number] |= set(np.unique(frame.instance[inside]).tolist())
        assert (frame.instance > 0)[frame.label != BACKGROUND].all()
        assert not frame.world_from_object
    assert [len(one) for one in names] == [1, 1]
    assert names[0] != names[1]


def test_what_stops_keeps_its_name(look: Any, new_mover: Any) -> None:
    stopping = new_mover(
        low=(14.0, -4.5, 0.15), size=(4.2, 1.8, 1.45), velocity=(-6.0, 0.0, 0.0), stops_after_s=0.8
    )
    street = look([stopping], count=20, speed=2.0)
    frames = perceive(street, StoppingOracle(street, [stopping]))
    car = int(np.bincount(frames[4].instance[street.on[4] == 1]).argmax())
    assert (frames[-1].label[street.on[-1] == 1] == STILL).mean() > 0.8
    assert (frames[-1].instance[street.on[-1] == 1] == car).mean() > 0.8


class StoppingOracle(Oracle):
    """Says that what has stopped does not move."""

    def _say(self, frame: Frame, world_from_sensor: np.ndarray, then: float) -> FrameReading:
        said = super()._say(frame, world_from_sensor, then)
        moves = said.dynamic if frame.stamp < self.movers[0].stops_after_s else 0 * said.dynamic
        return FrameReading(said.foreground, moves, said.offset)


def close(street: Any, mover: int) -> list[np.ndarray]:
    """For each frame: which points are on a mover and as near as the carrier may be."""
    return [
        (np.linalg.norm(frame.frame.points, axis=1) < 2.5) & (on == mover)
        for frame, on in zip(street.frames, street.on, strict=True)
    ]


def test_what_goes_beside_the_carrier_is_whole(look: Any, new_mover: Any) -> None:
    """The middle of a bus that keeps pace is never farther away than the carrier may be."""
    bus = new_mover(low=(-5.0, 1.4, 0.2), size=(12.0, 2.5, 3.0), velocity=(6.0, 0.0, 0.0))
    street = look([bus], count=9, speed=6.0)
    frames = perceive(street, Oracle(street, [bus]))
    for frame, near in zip(frames, close(street, 1), strict=True):
        assert near.sum() > 2000
        assert (frame.label[near] == MOVING).mean() > 0.9
    assert moved_share(frames, street.on) < 0.005


class StandingOracle(Oracle):
    """Says of all its movers that they can move and do not."""

    def _say(self, frame: Frame, world_from_sensor: np.ndarray, then: float) -> FrameReading:
        said = super()._say(frame, world_from_sensor, then)
        return FrameReading(said.foreground, 0 * said.dynamic, said.offset)


def test_a_parked_car_is_whole_beside_the_carrier_and_the_carrier_is_none(
    look: Any, new_mover: Any
) -> None:
    parked = new_mover(low=(3.0, 1.3, 0.2), size=(4.2, 1.8, 1.45), velocity=(0.0, 0.0, 0.0))
    carrier = new_mover(low=(-2.0, -0.9, 0.2), size=(4.0, 1.8, 1.2), velocity=(6.0, 0.0, 0.0))
    street = look([parked, carrier], count=9, speed=6.0)
    frames = perceive(street, StandingOracle(street, [parked, carrier]))
    passed = 0
    for frame, car, own in zip(frames, close(street, 1), close(street, 2), strict=True):
        passed += car.sum()
        assert (frame.label[car] == STILL).sum() >= 0.9 * car.sum()
        assert own.sum() > 5000
        assert (frame.label[own] == BACKGROUND).all()
    assert passed > 10_000


def test_bonnet_and_tail_of_the_carrier_are_no_movers(look: Any, new_mover: Any) -> None:
    """They reach beyond what is cut out about the sensor, and go as it goes; as do cars near by."""
    carrier = new_mover(low=(-5.0, -1.2, 0.2), size=(10.0, 2.4, 1.0), velocity=(6.0, 0.0, 0.0))
    beside = new_mover(low=(-1.0, 2.2, 0.2), size=(4.2, 1.8, 1.45), velocity=(6.0, 0.0, 0.0))
    ahead = new_mover(low=(9.0, -0.9, 0.2), size=(4.2, 1.8, 1.45), velocity=(6.0, 0.0, 0.0))
    street = look([carrier, beside, ahead], count=9, speed=6.0)
    frames = perceive(street, Oracle(street, [carrier, beside, ahead]))
    for frame, on in zip(frames, street.on, strict=True):
        assert (on == 1).sum() > 5000
        assert not (frame.label[on == 1] == MOVING).any()
        assert (frame.label[on == 2] == MOVING).mean() > 0.9
        assert (frame.label[on == 3] == MOVING).mean() > 0.9


class GreedyOracle(Oracle):
    """Takes all that stands beside a mover for a part of it."""

    def _say(self, frame: Frame, world_from_sensor: np.ndarray, then: float) -> FrameReading:
        said = super()._say(frame, world_from_sensor, then)
        world = rigid.transform(world_from_sensor, frame.points)
        (mover,) = self.movers
        middle = (mover.place(frame.stamp) + np.array(mover.size) / 2)[:2]
        goal = (mover.place(then) + np.array(mover.size) / 2)[:2]
        beside = (np.linalg.norm(world[:, :2] - middle, axis=1) < 2.2) & (world[:, 2] > 0.1)
        sure, offset = said.dynamic.copy(), said.offset.copy()
        sure[beside], offset[beside] = 1.0, goal - world[beside, :2]
        return FrameReading(np.maximum(said.foreground, sure), sure, offset)


@dataclass(frozen=True)
class Short(Oracle):
    """Knows all but how far movers go: a fifth too little."""

    def track(self, reading: WindowReading, instances: Sequence[np.ndarray]) -> ObjectReading:
        said = super().track(reading, instances)
        motions = said.target_from_aligned.copy()
        motions[..., :3, 3] *= 0.8
        return replace(said, target_from_aligned=motions)


def test_a_whole_mover_stands_for_its_end_that_was_seen_through(look: Any, new_mover: Any) -> None:
    """Its end alone suits a motion a little better that is not the mover's."""
    truck = new_mover(low=(10.54, -3.46, 0.0), size=(7.08, 2.0, 2.2), velocity=(2.52, 4.66, 0.0))
    street = look([truck], count=3)
    frames = perceive(street, Short(street, [truck]))
    pairs = list(zip(frames, street.on, strict=True))
    found = sum((frame.label[on == 1] == MOVING).sum() for frame, on in pairs)
    assert found > 0.9 * sum((on == 1).sum() for _, on in pairs)
    assert moved_share(frames, street.on) < 0.005


def test_what_stands_where_a_mover_passes_does_not_go_along(look: Any, new_mover: Any) -> None:
    cyclist = new_mover(low=(1.0, 3.3, 0.0), size=(1.8, 0.6, 1.7), velocity=(4.5, 0.0, 0.0))
    street = look([cyclist], count=34)
    frames = perceive(street, GreedyOracle(street, [cyclist]))
    said = np.concatenate([frame.label == MOVING for frame in frames])
    on = np.concatenate(street.on) == 1
    assert said[on].mean() > 0.97
    assert (said & ~on).sum() < 0.01 * on.sum()


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_short_drives_leave_whole(look: Any, new_mover: Any, count: int) -> None:
    walker = new_mover(low=(9.0, 3.0, 0.0), size=(0.5, 0.5, 1.75), velocity=(0.0, -1.6, 0.0))
    street = look([walker], count=count)
    frames = perceive(street, Oracle(street, [walker]))
    assert [frame.registered.index for frame in frames] == list(range(count))


def test_a_frame_without_points_is_no_trouble(busy_street: Any, fresh: NetworkReader) -> None:
    from dataclasses import replace

    frames = list(busy_street.frames[:6])
    empty = Frame(np.zeros((0, 3), np.float32), frames[3].frame.stamp)
    frames[3] = replace(frames[3], frame=empty)
    answers = NetworkLed(fresh).perceive(frames)
    assert [len(one.label) for one in answers] == [len(one.frame) for one in frames]


class Broken(Liar):
    """Cannot read the frame of that stamp."""

    def read(self, frame: Frame) -> Frame:
        if frame.stamp == self.speed_mps:
            raise MemoryError(f"no room for frame {frame.stamp}")
        return frame


def test_an_error_of_the_network_reaches_the_caller(busy_street: Any) -> None:
    stamp = busy_street.frames[4].frame.stamp
    with pytest.raises(MemoryError, match=f"frame {stamp}"):
        perceive(busy_street, Broken(stamp))


class Blind(Liar):
    """Can read frames and cannot look at the window that ends with the frame of that stamp."""

    def look(
        self, encoded: Sequence[Frame], world_from_sensor: np.ndarray, target: int
    ) -> WindowReading:
        if encoded[-1].stamp == self.speed_mps:
            raise MemoryError(f"no room for window {encoded[-1].stamp}")
        return super().look(encoded, world_from_sensor, target)


def test_an_error_in_looking_reaches_the_caller(busy_street: Any) -> None:
    stamp = busy_street.frames[-1].frame.stamp
    with pytest.raises(MemoryError, match=f"window {stamp}"):
        perceive(busy_street, Blind(stamp))


@dataclass(frozen=True)
class Counting(Liar):
    """Notes the frames it reads."""

    read_stamps: list[float] = field(default_factory=list)

    def read(self, frame: Frame) -> Frame:
        self.read_stamps.append(frame.stamp)
        return frame


def test_each_frame_is_read_once_in_order(busy_street: Any) -> None:
    reader = Counting(2.0)
    frames = perceive(busy_street, reader)
    assert reader.read_stamps == [frame.registered.frame.stamp for frame in frames]


def test_no_thread_outlives_its_caller(busy_street: Any) -> None:
    before = threading.active_count()
    answers = NetworkLed(Liar(2.0)).perceive(busy_street.frames)
    next(answers)
    answers.close()
    assert threading.active_count() == before
