"""The network behind its door: arrays in, arrays out, in the caller's coordinates and rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid
from lidaraccum.model.network import Network
from lidaraccum.model.reader import NetworkReader
from lidaraccum.model.reading import WindowReading


@pytest.fixture(scope="module")
def reader(network: Network) -> NetworkReader:
    return NetworkReader(network)


def poses(count: int) -> np.ndarray:
    return np.stack([rigid.translation((0.9 * index, 0.0, 0.0)) for index in range(count)])


def look(
    reader: NetworkReader, frames: list[Frame], world_from_sensor: np.ndarray, target: int = 0
) -> WindowReading:
    return reader.look([reader.read(frame) for frame in frames], world_from_sensor, target)


def halves(frames: list[Frame]) -> list[np.ndarray]:
    """Object 5 ahead, object 9 behind."""
    return [np.where(frame.points[:, 0] > 0, 5, 9) for frame in frames]


def test_probabilities_for_the_points_on_the_grid_background_for_the_rest(
    reader: NetworkReader, frames: list[Frame]
) -> None:
    reading = look(reader, frames[:3], poses(3))
    for frame, said in zip(frames, reading.frames, strict=False):
        outside = np.abs(frame.points[:, :2]).max(axis=1) > 17.0
        assert said.foreground[~outside].any()
        assert ((said.foreground >= 0) & (said.foreground <= 1)).all()
        assert not said.foreground[outside].any()
        assert not said.dynamic[outside].any()
        assert not said.offset[outside].any()


def test_a_sensor_of_many_points_is_answered_point_by_point(
    reader: NetworkReader, frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the network has no time to read is no background."""
    whole = look(reader, frames[:3], poses(3))
    monkeypatch.setattr("lidaraccum.model.reader.MOST_POINTS", 4000)
    some = look(reader, frames[:3], poses(3))
    for every, few in zip(whole.frames, some.frames, strict=True):
        assert np.count_nonzero(every.foreground) > 2000
        np.testing.assert_array_equal(few.foreground > 0, every.foreground > 0)
        assert np.abs(few.foreground - every.foreground).mean() < 0.05


def test_answers_lie_in_the_frame_s_own_rows(reader: NetworkReader, frames: list[Frame]) -> None:
    rng = np.random.default_rng(2)
    orders = [rng.permutation(len(frame)) for frame in frames[:2]]
    mixed = [
        frame.with_points(frame.points[order])
        for frame, order in zip(frames[:2], orders, strict=True)
    ]
    straight, again = look(reader, frames[:2], poses(2)), look(reader, mixed, poses(2))
    for before, after, order in zip(straight.frames, again.frames, orders, strict=True):
        np.testing.assert_allclose(after.dynamic, before.dynamic[order], atol=0.05)
        np.testing.assert_allclose(after.offset, before.offset[order], atol=0.1)


def test_turning_the_world_turns_the_offsets(reader: NetworkReader, frames: list[Frame]) -> None:
    turn = rigid.exponential(np.array([0, 0, 1.3, 5.0, -2.0, 0.5]))
    before = look(reader, frames[:3], poses(3), target=1)
    after = look(reader, frames[:3], turn @ poses(3), target=1)
    for one, other in zip(before.frames, after.frames, strict=True):
        np.testing.assert_allclose(other.foreground, one.foreground, atol=0.02)
        np.testing.assert_allclose(other.offset, one.offset @ turn[:2, :2].T, atol=0.05)


def test_motions_of_named_objects(reader: NetworkReader, frames: list[Frame]) -> None:
    reading = look(reader, frames[:3], poses(3), target=2)
    objects = reader.track(reading, halves(frames[:3]))
    assert objects.ids.tolist() == [5, 9]
    assert objects.seen.all()
    assert objects.anchor.tolist() == [2, 2]
    assert objects.target_from_aligned.shape == (2, 3, 4, 4)
    still = np.tile(np.eye(4), (2, 1, 1))
    np.testing.assert_allclose(objects.target_from_aligned[:, 2], still, atol=1e-6)
    turns = objects.target_from_aligned[:, :, :3, :3]  # fresh weights say that nothing turns
    np.testing.assert_allclose(turns, np.tile(np.eye(3), (2, 3, 1, 1)), atol=0.05)


def test_a_frame_that_says_nothing_is_left_out(reader: NetworkReader, frames: list[Frame]) -> None:
    empty = Frame(np.zeros((0, 3), np.float32), stamp=0.1)
    far = Frame(np.full((80, 3), 500.0, np.float32), stamp=0.2)
    mixed = [frames[0], empty, far, frames[3]]
    reading = look(reader, mixed, poses(4), target=2)
    assert reading.target == 3
    assert [len(one.foreground) for one in reading.frames] == [len(frame) for frame in mixed]
    assert reading.frames[0].foreground.any()
    objects = reader.track(reading, [np.ones(len(frame), dtype=np.int64) for frame in mixed])
    assert objects.seen.tolist() == [[True, False, False, True]]
    assert objects.anchor.tolist() == [3]


@pytest.mark.parametrize("count", [1, 2])
def test_nothing_is_said_of_fewer_than_two_frames(
    reader: NetworkReader, frames: list[Frame], count: int
) -> None:
    nothing = Frame(np.zeros((3, 3), np.float32), stamp=0.1)
    window = [frames[0], nothing][:count]
    reading = look(reader, window, poses(count))
    assert not any(one.foreground.any() for one in reading.frames)
    assert len(reader.track(reading, halves(window)).ids) == 0


def test_no_named_point_is_no_object(reader: NetworkReader, frames: list[Frame]) -> None:
    reading = look(reader, frames[:2], poses(2))
    none: list[Any] = [np.zeros(len(frame), dtype=np.int64) for frame in frames[:2]]
    assert len(reader.track(reading, none).ids) == 0


def test_its_caller_keeps_his_threads(reader: NetworkReader, frames: list[Frame]) -> None:
    torch.set_num_threads(2)
    reader.read(frames[0])
    assert torch.get_num_threads() == 2
