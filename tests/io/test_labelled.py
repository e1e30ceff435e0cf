"""A labelled sequence that was written is read back the same; label files cover every row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.data.accumulation import AccumulatedFrame
from lidaraccum.data.frame import Box, Frame, Labels
from lidaraccum.errors import OutputExistsError, SettingsError
from lidaraccum.geometry import rigid
from lidaraccum.io.label_files import write_label_file
from lidaraccum.io.labelled import LabelledSettings, write_labelled_sequence
from lidaraccum.io.sequences import open_sequence

Cloud = Callable[..., NDArray[np.float32]]


@dataclass
class Drive:
    """A labelled sequence in memory."""

    frames: list[Frame]
    truth: list[Labels]
    name: str = "drive"
    rate_hz: float = 10.0
    poses: NDArray[np.float64] | None = None
    crs_wkt: str | None = None
    fails_at: set[int] = field(default_factory=set)

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int, /) -> Frame:
        if index in self.fails_at:
            raise RuntimeError("the sensor went away")
        return self.frames[index]

    def labels(self, index: int, /) -> Labels:
        return self.truth[index]


@pytest.fixture
def drive(cloud: Cloud) -> Drive:
    rng = np.random.default_rng(0)
    frames, truth = [], []
    for i in range(3):
        points = np.round(cloud(seed=i), 3)
        frames.append(
            Frame(
                points,
                stamp=50.0 + 0.1 * i,
                intensity=rng.integers(0, 256, 200).astype(np.uint8),
                time_offset=rng.uniform(-0.05, 0.05, 200),
                ring=rng.integers(0, 64, 200).astype(np.uint16),
                attributes={"gain": rng.random(200).astype(np.float32)},
            )
        )
        box = Box(3, "Car", (4.1, 1.9, 1.5), rigid.exponential(rng.normal(size=6)), 7.25, True)
        truth.append(
            Labels(
                world_from_sensor=rigid.exponential(np.array([0, 0, 0.1, 1, 0, 0]) * i),
                foreground=rng.random(200) < 0.3,
                dynamic=rng.random(200) < 0.1,
                instance=rng.integers(0, 4, 200).astype(np.int32),
                boxes=(box,),
                annotated=rng.random(200) < 0.9,
                semantic=rng.integers(0, 20, 200).astype(np.int16),
                points_at_stamp=rng.normal(size=(200, 3)).astype(np.float32),
            )
        )
    return Drive(frames, truth)


@pytest.mark.parametrize("form", ["ply", "laz", "las", "bin"])
def test_write_read_is_identity(tmp_path: Path, drive: Drive, form: str) -> None:
    write_labelled_sequence(tmp_path / "out", drive, LabelledSettings(format=form, sensor="S"))
    back = open_sequence(tmp_path / "out")
    assert back.info.layout == "labelled sequence"
    assert len(back) == 3
    assert back.rate_hz == pytest.approx(10.0)
    tolerance = {"rtol": 0, "atol": 0 if form in ("ply", "bin") else 1e-5}
    for i in range(3):
        frame, expected = back[i], drive[i]
        np.testing.assert_allclose(frame.points, expected.points, **tolerance)
        assert frame.stamp == expected.stamp
        np.testing.assert_array_equal(frame.intensity, expected.intensity)
        np.testing.assert_array_equal(frame.ring, expected.ring)
        np.testing.assert_array_equal(frame.attributes["gain"], expected.attributes["gain"])
        np.testing.assert_allclose(frame.time_offset, expected.time_offset, atol=1e-8)
        if form == "ply":
            assert frame.intensity.dtype == expected.intensity.dtype
            assert frame.ring.dtype == expected.ring.dtype


def test_the_truth_is_read_back_identically(tmp_path: Path, drive: Drive) -> None:
    write_labelled_sequence(tmp_path / "out", drive)
    back = open_sequence(tmp_path / "out")
    for i in range(3):
        labels, expected = back.labels(i), drive.labels(i)
        names = ("foreground", "dynamic", "instance", "annotated", "semantic", "points_at_stamp")
        for name in names:
            np.testing.assert_array_equal(getattr(labels, name), getattr(expected, name))
        np.testing.assert_allclose(labels.world_from_sensor, expected.world_from_sensor, atol=1e-12)
        box, box_expected = labels.boxes[0], expected.boxes[0]
        np.testing.assert_array_equal(box.sensor_from_object, box_expected.sensor_from_object)
        assert (box.id, box.category, box.size_lwh, box.speed_mps, box.dynamic) == (
            box_expected.id,
            box_expected.category,
            box_expected.size_lwh,
            box_expected.speed_mps,
            box_expected.dynamic,
        )


def test_what_was_read_can_be_written_and_read_again(tmp_path: Path, drive: Drive) -> None:
    write_labelled_sequence(tmp_path / "one", drive)
    write_labelled_sequence(tmp_path / "two", open_sequence(tmp_path / "one"))
    for name in ("000000.ply", "000002.ply"):
        one, two = (tmp_path / place / "frames" / name for place in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()


def test_georeferenced_frames_keep_their_place(tmp_path: Path, drive: Drive, cloud: Cloud) -> None:
    there = Frame(cloud(), origin=np.array([500_000.0, 5_400_000.0, 300.0]))
    drive.frames = [there] * 3
    write_labelled_sequence(tmp_path / "out", drive)
    frame = open_sequence(tmp_path / "out")[0]
    back = frame.points + frame.origin
    np.testing.assert_allclose(back, there.points + there.origin, rtol=0, atol=1e-4)


def test_a_failure_leaves_nothing(tmp_path: Path, drive: Drive) -> None:
    drive.fails_at = {2}
    with pytest.raises(RuntimeError, match="went away"):
        write_labelled_sequence(tmp_path / "out", drive)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_folder_is_replaced_only_when_asked(tmp_path: Path, drive: Drive) -> None:
    write_labelled_sequence(tmp_path / "out", drive)
    with pytest.raises(OutputExistsError):
        write_labelled_sequence(tmp_path / "out", drive)
    drive.frames, drive.truth = drive.frames[:2], drive.truth[:2]
    write_labelled_sequence(tmp_path / "out", drive, LabelledSettings(overwrite=True))
    assert len(open_sequence(tmp_path / "out")) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_unknown_frame_format_is_a_wrong_setting() -> None:
    with pytest.raises(SettingsError, match="laz"):
        LabelledSettings(format="xyz")


def test_label_files_have_a_word_for_every_input_row(
    tmp_path: Path, accumulated: Callable[..., AccumulatedFrame]
) -> None:
    frame = accumulated(count=5)
    object.__setattr__(frame, "rows", np.array([0, 2, 3, 5, 6]))
    object.__setattr__(frame, "row_count", 8)
    object.__setattr__(frame, "label", np.array([0, 1, 2, 2, 0], np.uint8))
    object.__setattr__(frame, "instance", np.array([0, 4, 5, 70000, 0], np.int32))
    write_label_file(tmp_path / "000000.label", frame)
    words = np.fromfile(tmp_path / "000000.label", "<u4")
    np.testing.assert_array_equal(words & 0xFFFF, [9, 0, 9, 251, 0, 251, 9, 0])
    np.testing.assert_array_equal(words >> 16, [0, 0, 4, 5, 0, 70000 % 65536, 0, 0])
