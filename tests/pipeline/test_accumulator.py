"""Laws of the whole pipeline, with an oracle where the network will stand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.accumulation import MOVING, Accumulation
from lidaraccum.data.frame import Box, Frame, Labels
from lidaraccum.errors import InputError, SettingsError
from lidaraccum.geometry import rigid
from lidaraccum.model.checkpoint import save_network
from lidaraccum.model.network import build_network
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.pipeline.accumulator import AccumulateSettings, Accumulator, accumulate
from lidaraccum.pipeline.perception import GivenLabels
from lidaraccum.pipeline.selection import SelectionSettings

MOVER, RATE_HZ = 7, 10.0


@dataclass(frozen=True)
class DriveWithMover:
    """The street drive with a box of points that moves: an in-memory labelled sequence."""

    drive: Any
    poses: np.ndarray | None = None
    name: str = "drive"
    rate_hz: float = RATE_HZ
    crs_wkt: str | None = None

    def __len__(self) -> int:
        return len(self.drive.frames)

    def world_from_object(self, index: int) -> np.ndarray:
        """Eight metres ahead, faster than the ego, turning a little."""
        return rigid.translation((12 + 1.3 * index, 1.5, 1.0)) @ rigid.exponential(
            np.array([0, 0, 0.05 * index, 0, 0, 0])
        )

    def body(self, index: int) -> np.ndarray:
        """The mover's points in its own coordinates; each frame sees others."""
        return np.random.default_rng(index).uniform([-2, -0.9, -0.7], [2, 0.9, 0.7], (300, 3))

    def __getitem__(self, index: int, /) -> Frame:
        sensor_from_world = rigid.invert(self.drive.world_from_sensor[index])
        moved = rigid.transform(sensor_from_world @ self.world_from_object(index), self.body(index))
        points = np.concatenate([self.drive.frames[index], moved.astype(np.float32)])
        return Frame(points, stamp=index / RATE_HZ, name=f"{index}")

    def labels(self, index: int, /) -> Labels:
        count = len(self.drive.frames[index])
        mover = np.arange(count + 300) >= count
        pose = self.drive.world_from_sensor[index]
        box = Box(
            MOVER,
            "Car",
            (4, 1.8, 1.4),
            rigid.invert(pose) @ self.world_from_object(index),
            13,
            True,
        )
        return Labels(pose, mover, mover, np.where(mover, MOVER, 0).astype(np.int32), (box,))


@pytest.fixture(scope="session")
def sequence(drive: Any) -> DriveWithMover:
    return DriveWithMover(drive, poses=drive.world_from_sensor)


def oracle(sequence: DriveWithMover, **more: Any) -> Accumulation:
    return accumulate(sequence, AccumulateSettings(method="oracle", **more))


@pytest.mark.parametrize(("reference", "anchor"), [("first", 0), ("last", 5), ("2", 2)])
def test_a_mover_is_put_together_where_the_reference_frame_saw_it(
    sequence: DriveWithMover, reference: str, anchor: int
) -> None:
    result = oracle(sequence, reference=reference)
    bodies = np.concatenate([sequence.body(index) for index in range(6)])
    reference_from_world = rigid.invert(sequence.drive.world_from_sensor[anchor])
    expected = rigid.transform(reference_from_world @ sequence.world_from_object(anchor), bodies)
    np.testing.assert_allclose(result.instance_points(MOVER), expected, atol=1e-4)
    assert (result.label[result.instance == MOVER] == MOVING).all()


def test_the_object_knows_its_motion_speed_and_size(sequence: DriveWithMover) -> None:
    track = oracle(sequence).objects[MOVER]
    assert track.points == 6 * 300
    assert np.linalg.norm(track.velocity) == pytest.approx(13.0, rel=1e-3)
    np.testing.assert_allclose(track.size_lwh, (4, 1.8, 1.4), atol=0.05)
    for index, motion in track.reference_from_frame.items():
        points = sequence[index].points[-300:]
        expected = rigid.transform(track.reference_from_frame[0], sequence[0].points[-300:])
        middle = rigid.transform(motion, points).mean(axis=0)
        np.testing.assert_allclose(middle, expected.mean(axis=0), atol=0.3)


def test_flow_takes_sensor_points_to_the_reference(sequence: DriveWithMover) -> None:
    result = oracle(sequence)
    for index in (0, 4):
        moved = sequence[index].points + result.flow(index)
        np.testing.assert_allclose(moved, result.positions[result.frame == index], atol=1e-4)


def test_the_clean_map_has_no_mover(sequence: DriveWithMover) -> None:
    kept = oracle(sequence, selection=SelectionSettings(drop_dynamic=True))
    assert len(kept) == sum(len(points) for points in sequence.drive.frames)
    np.testing.assert_array_equal(kept.positions, oracle(sequence).static)


def test_every_point_comes_out_once_in_order(sequence: DriveWithMover) -> None:
    result = accumulate(sequence, AccumulateSettings(method="ego-only"))
    counts = [len(sequence[index]) for index in range(6)]
    np.testing.assert_array_equal(result.frame, np.repeat(range(6), counts))
    assert set(np.unique(result.label)) == {0}


@dataclass(frozen=True)
class Recorded:
    """Frames in memory."""

    frames: list[Frame]
    poses: np.ndarray | None = None
    name: str = "recorded"
    rate_hz: float = RATE_HZ
    crs_wkt: str | None = None

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int, /) -> Frame:
        return self.frames[index]


@pytest.mark.parametrize("method", ["label-free", "network"])
def test_a_process_more_changes_nothing(
    look: Any, new_mover: Any, tmp_path: Path, method: str
) -> None:
    small = NetworkSettings(extent_m=32.0, base_widths=(16, 24, 32), motion_widths=(32, 48))
    save_network(build_network(small, seed=3), tmp_path / "weights.safetensors")
    weights = tmp_path / "weights.safetensors" if method == "network" else None
    settings = AccumulateSettings(method=method, weights=weights)
    mover = new_mover(low=(12.0, -2.0, 0.0), size=(4.0, 1.8, 1.5), velocity=(4.0, 0.0, 0.0))
    sequence = Recorded([one.frame for one in look([mover], count=15).frames])
    one, two = (list(Accumulator(sequence, settings, processes=count).frames()) for count in (1, 2))
    assert any((frame.label == MOVING).any() for frame in one)
    for here, there in zip(one, two, strict=True):
        np.testing.assert_array_equal(here.points, there.points)
        np.testing.assert_array_equal(here.label, there.label)
        np.testing.assert_array_equal(here.confidence, there.confidence)


def test_a_perceiver_that_looks_for_nothing_has_a_process_more(sequence: DriveWithMover) -> None:
    settings = AccumulateSettings(method="label-free")
    run = Accumulator(sequence, settings, perceiver=GivenLabels(sequence), processes=2)
    labels = np.concatenate([frame.label for frame in run.frames()])
    np.testing.assert_array_equal(labels, oracle(sequence).label)


def test_one_frame_is_too_few(sequence: DriveWithMover) -> None:
    class Short(DriveWithMover):
        def __len__(self) -> int:
            return 1

    with pytest.raises(InputError, match="at least 2"):
        accumulate(Short(sequence.drive))


@pytest.mark.parametrize("reference", ["6", "-7", "nearest"])
def test_a_reference_that_is_not_there_is_refused(sequence: DriveWithMover, reference: str) -> None:
    with pytest.raises(SettingsError):
        accumulate(sequence, AccumulateSettings(reference=reference))


def test_the_world_is_only_known_from_given_poses(drive: Any) -> None:
    with pytest.raises(SettingsError, match="given poses"):
        accumulate(DriveWithMover(drive), AccumulateSettings(reference="world"))
