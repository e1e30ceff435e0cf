"""What weights are scored on at the end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

from lidaraccum.data.frame import Labels
from lidaraccum.errors import InputError, SettingsError
from lidaraccum.model.network import build_network
from lidaraccum.simulation.settings import DriveSettings
from lidaraccum.simulation.windows import FIRST_TEST_SEED, TEST_WINDOWS
from lidaraccum.training import exam
from lidaraccum.training.exam import ExamSettings, examine, recorded_windows, simulated_windows


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, toy: ModuleType) -> list[DriveSettings]:
    """What is asked of the simulator, a car park given in its place."""
    settings: list[DriveSettings] = []

    def stand_in(wanted: DriveSettings) -> object:
        settings.append(wanted)
        return toy.CarPark(wanted.seed % 5, 3)

    monkeypatch.setattr(exam, "simulate", stand_in)
    monkeypatch.setattr(exam, "open_sequence", lambda folder: toy.CarPark(1, int(folder.name)))
    return settings


def test_windows_are_spread_over_the_test_set(asked: list[DriveSettings], toy: ModuleType) -> None:
    assert len(list(simulated_windows(4, 16.0, toy.SMALL))) == 4
    places = {settings.seed - FIRST_TEST_SEED for settings in asked}
    assert len(places) == 4
    assert min(places) >= 0
    assert TEST_WINDOWS > max(places) >= min(places) + TEST_WINDOWS // 2
    assert all(settings.compensated and not settings.dense for settings in asked)
    assert not any(settings.beside for settings in asked)
    (_,) = simulated_windows(1, 16.0, toy.SMALL, dense=0.5, beside=2.0)
    assert asked[-1] == replace(asked[0], dense=0.5, beside=2.0)


def test_windows_are_spread_over_a_recording(asked: list[DriveSettings], toy: ModuleType) -> None:
    batches = list(recorded_windows(Path("9"), 3, 16.0, toy.SMALL))
    assert [batch.frames.stamps[0] for batch in batches] == pytest.approx([0.0, 0.2, 0.4])
    assert {batch.windows.lengths for batch in batches} == {(exam.WINDOW,)}
    # A recording that has no more is not scored twice in one place.
    assert len(list(recorded_windows(Path("6"), 3, 16.0, toy.SMALL))) == 2
    with pytest.raises(InputError, match="too few"):
        list(recorded_windows(Path("4"), 3, 16.0, toy.SMALL))


def test_windows_may_be_seen_by_a_sensor_mounted_otherwise(
    asked: list[DriveSettings], toy: ModuleType
) -> None:
    quarter = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    pairs = [
        (recorded_windows(Path("5"), 1, 16.0, toy.SMALL, yaw_deg=yaw) for yaw in (0.0, 90.0)),
        (simulated_windows(1, 16.0, toy.SMALL, yaw_deg=yaw) for yaw in (0.0, 90.0)),
    ]
    for pair in pairs:
        (before,), (after,) = pair
        told = before.truth.target_from_frame[:, :3, 3]
        moved = after.truth.target_from_frame[:, :3, 3]
        assert told.abs().max() > 0.1
        torch.testing.assert_close(moved, told @ quarter.T, atol=1e-4, rtol=0)
        assert before.truth.dynamic.sum() == after.truth.dynamic.sum()


def test_points_of_no_class_may_be_left_out(
    asked: list[DriveSettings], toy: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Classed(toy.CarPark):  # type: ignore[misc,name-defined]
        def labels(self, index: int) -> Labels:
            labels = super().labels(index)
            semantic = np.arange(len(labels.instance), dtype=np.int16) % 3 - 1
            return replace(labels, semantic=semantic)

    monkeypatch.setattr(exam, "open_sequence", lambda folder: Classed(1, 5))
    (all_of_them,) = recorded_windows(Path("5"), 1, 16.0, toy.SMALL)
    (named,) = recorded_windows(Path("5"), 1, 16.0, toy.SMALL, classed=True)
    assert all_of_them.truth.annotated.all()
    assert named.truth.annotated.float().mean() == pytest.approx(1 / 3, abs=0.05)


def test_every_part_is_scored_or_none(asked: list[DriveSettings], toy: ModuleType) -> None:
    settings = ExamSettings(2, 16.0, drives=(Path("5"), Path("6")), drive_windows=2)
    network = build_network(toy.SMALL)
    marks = examine(network, settings, lambda: False)
    assert marks is not None
    assert marks.simulated.windows == 2
    assert {name: scores.windows for name, scores in marks.recorded.items()} == {"5": 1, "6": 2}
    asked.clear()
    assert examine(network, settings, lambda: len(asked) == 2) is None
    assert len(asked) == 2


def test_recordings_of_one_name_cannot_be_told_apart() -> None:
    with pytest.raises(SettingsError, match="names"):
        ExamSettings(drives=(Path("a/drive"), Path("b/drive")))
