"""Laws of drives kept on the disk."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from lidaraccum.errors import SettingsError
from lidaraccum.training.kept import KeptDrives, StoredDrive, store_drive
from lidaraccum.training.loader import store_all

REACH_M = 8.0


def kept(toy: ModuleType, folder: Path, distinct: int = 3) -> KeptDrives:
    return KeptDrives(folder, toy.CarPark, distinct, toy.SMALL, toy.WINDOWS)


def test_a_stored_drive_tells_what_the_drive_told(toy: ModuleType, tmp_path: Path) -> None:
    drive = toy.CarPark(1)
    store_drive(drive, tmp_path / "drive.npz", REACH_M)
    stored = StoredDrive(tmp_path / "drive.npz")
    assert len(stored) == len(drive)
    assert stored.rate_hz == pytest.approx(drive.rate_hz)
    for index in range(len(drive)):
        frame, labels = drive[index], drive.labels(index)
        near = np.linalg.norm(frame.points[:, :2], axis=1) < REACH_M
        assert 0 < near.sum() < len(near)
        back, told = stored[index], stored.labels(index)
        np.testing.assert_array_equal(back.points, frame.points[near])
        assert back.stamp == frame.stamp
        np.testing.assert_array_equal(told.instance, labels.instance[near])
        np.testing.assert_array_equal(told.foreground, labels.foreground[near])
        np.testing.assert_array_equal(told.dynamic, labels.dynamic[near])
        np.testing.assert_array_equal(told.world_from_sensor, labels.world_from_sensor)
        assert [(b.id, b.category, b.size_lwh, b.speed_mps, b.dynamic) for b in told.boxes] == [
            (b.id, b.category, b.size_lwh, b.speed_mps, b.dynamic) for b in labels.boxes
        ]
        for mine, theirs in zip(told.boxes, labels.boxes, strict=True):
            np.testing.assert_array_equal(mine.sensor_from_object, theirs.sensor_from_object)


def test_what_a_number_gives_does_not_depend_on_what_is_stored(
    toy: ModuleType, tmp_path: Path
) -> None:
    first, second = kept(toy, tmp_path / "a"), kept(toy, tmp_path / "b")
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
    second.windows(4)
    for mine, theirs in zip(first.windows(1), second.windows(1), strict=True):
        assert mine.target == theirs.target
        for one, other in zip(mine.frames, theirs.frames, strict=True):
            np.testing.assert_array_equal(one.points, other.points)


def test_every_drive_has_its_turn_and_is_made_once(toy: ModuleType, tmp_path: Path) -> None:
    source = kept(toy, tmp_path)
    for number in range(3):
        source.windows(number)
    made = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert len(made) == 3
    again = source.windows(3)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == made
    assert len(again) == toy.WINDOWS.windows_per_drive


def test_the_same_drive_is_cut_another_way_the_next_time(toy: ModuleType, tmp_path: Path) -> None:
    source = kept(toy, tmp_path, distinct=1)
    first, second = source.windows(0)[0], source.windows(1)[0]
    same = len(first.frames) == len(second.frames) and np.array_equal(
        first.frames[0].points, second.frames[0].points
    )
    assert not same


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 1])
def test_what_is_missing_is_made_and_nothing_else(
    toy: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers: int
) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))  # workers look for the car park, too
    source = kept(toy, tmp_path, distinct=4)
    source.stored(2)
    assert list(store_all(source, workers)) == [0, 1, 3]
    assert source.missing() == []
    assert list(store_all(source, workers)) == []


def test_none_is_not_a_number_of_drives(toy: ModuleType, tmp_path: Path) -> None:
    with pytest.raises(SettingsError):
        kept(toy, tmp_path, distinct=0)
