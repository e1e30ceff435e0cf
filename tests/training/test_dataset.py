"""Which drive gives which windows, and which drives never train."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from lidaraccum.errors import InputError, SettingsError
from lidaraccum.simulation import drive as simulated
from lidaraccum.simulation.settings import DriveSettings
from lidaraccum.simulation.windows import (
    FIRST_TEST_SEED,
    TEST_WINDOWS,
    held_out_settings,
)
from lidaraccum.training import dataset
from lidaraccum.training.augment import NO_AUGMENTATION
from lidaraccum.training.dataset import (
    FIRST_VALIDATION_SEED,
    RecordedDrives,
    SimulatedDrives,
    ValidationDrives,
    WindowSettings,
)
from lidaraccum.training.loader import batches_from
from lidaraccum.training.window import TrainingWindow

Windows = list[TrainingWindow]


def same(one: TrainingWindow, other: TrainingWindow) -> bool:
    """Whether two windows agree to the bit."""
    return (
        one.target == other.target
        and len(one.frames) == len(other.frames)
        and np.array_equal(one.target_from_sensor, other.target_from_sensor)
        and np.array_equal(one.level_from_object, other.level_from_object)
        and all(
            np.array_equal(mine.points, its.points) and mine.stamp == its.stamp
            for mine, its in zip(one.frames, other.frames, strict=True)
        )
        and all(
            np.array_equal(mine.object_row, its.object_row)
            for mine, its in zip(one.truth, other.truth, strict=True)
        )
    )


def first_batches(source: object, count: int, workers: int) -> list[Windows]:
    batches = batches_from(source, 0, 2, 2, workers)
    found = [next(batches) for _ in range(count)]
    batches.close()
    return found


@pytest.mark.slow
def test_a_worker_makes_the_same_windows(toy: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))  # workers look for the car park, too
    here = first_batches(toy.CarParks(), 3, 0)
    there = first_batches(toy.CarParks(), 3, 1)
    for mine, its in zip(here, there, strict=True):
        assert len(mine) == len(its) == 2
        assert all(map(same, mine, its))
    assert not same(here[0][0], here[0][1])


def test_a_resumed_stream_goes_on_where_it_stopped(toy: ModuleType) -> None:
    whole = first_batches(toy.CarParks(), 5, 0)
    for step in range(1, 5):
        batches = batches_from(toy.CarParks(), step, 2, 2, 0)
        assert all(map(same, next(batches), whole[step]))


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, toy: ModuleType) -> list[DriveSettings]:
    """What is asked of the simulator, a car park given in its place."""
    settings: list[DriveSettings] = []

    def stand_in(wanted: DriveSettings, caster: object = None) -> object:
        settings.append(wanted)
        return toy.CarPark(wanted.seed % 5, wanted.frames)

    assert dataset.simulate is simulated.simulate
    monkeypatch.setattr(dataset, "simulate", stand_in)
    return settings


def test_training_validation_and_test_never_share_a_drive(
    asked: list[DriveSettings], toy: ModuleType
) -> None:
    settings = replace(toy.WINDOWS, windows_per_drive=1)
    for seed in (0, 1, 189):
        source = SimulatedDrives(toy.SMALL, settings, seed)
        for drive in (0, 1, 9_999_999):
            source.windows(drive)
    trained = {settings.seed for settings in asked}
    assert len(trained) == 9
    asked.clear()
    for drive in (0, 1, 1_000_000):
        ValidationDrives(toy.SMALL, 16.0).windows(drive)
    validated = {settings.seed for settings in asked}
    tested = {held_out_settings(index).seed for index in range(TEST_WINDOWS)}
    assert max(trained) < FIRST_VALIDATION_SEED <= min(validated)
    assert max(validated) < FIRST_TEST_SEED <= min(tested)


def test_sensors_that_are_named_and_no_others_drive_the_same_streets(
    asked: list[DriveSettings], toy: ModuleType
) -> None:
    SimulatedDrives(toy.SMALL, toy.WINDOWS).make(4)
    named = replace(toy.WINDOWS, sensors=("VLP-16", "OS1-64"))
    for drive in range(12):
        SimulatedDrives(toy.SMALL, named).make(drive)
    SimulatedDrives(toy.SMALL, named).make(4)
    usual, *others, again = asked
    assert usual.sensor is None
    assert {settings.sensor for settings in others} == {"VLP-16", "OS1-64"}
    assert again == others[4]
    assert replace(others[4], sensor=None) == usual
    with pytest.raises(SettingsError, match="VLP-61"):
        replace(toy.WINDOWS, sensors=("VLP-61",))


def test_what_is_rare_is_met_more_often_in_every_other_drive(
    asked: list[DriveSettings], toy: ModuleType
) -> None:
    usual, often = SimulatedDrives(toy.SMALL, toy.WINDOWS), replace(toy.WINDOWS, rare=5.0)
    for drive in range(4):
        usual.make(drive)
        SimulatedDrives(toy.SMALL, often).make(drive)
    assert [one.rare for one in asked] == [1.0, 1.0, 1.0, 5.0] * 2
    assert all(
        replace(here, rare=1.0) == there
        for there, here in zip(asked[::2], asked[1::2], strict=True)
    )
    with pytest.raises(SettingsError, match="rare"):
        replace(toy.WINDOWS, rare=0.0)


def test_what_is_simulated_is_as_the_settings_ask(
    asked: list[DriveSettings], toy: ModuleType
) -> None:
    SimulatedDrives(toy.SMALL, toy.WINDOWS).make(1)
    changes = {
        "green": 0.0, "dense": 0.5, "beside": 0.7, "beam_bias": 2.0,
        "furniture": False, "rolling_shutter": False, "exact": True,
    }  # fmt: skip
    plain = replace(toy.WINDOWS, **changes)
    SimulatedDrives(toy.SMALL, plain).make(1)
    usual, asked_for = asked
    assert (usual.green, usual.rolling_shutter, usual.exact) == (1.0, None, False)
    assert usual.furniture
    assert asked_for == replace(usual, **changes)
    for name, value in (("green", -1.0), ("dense", 1.5), ("beside", -1.0), ("beam_bias", 0.5)):
        with pytest.raises(SettingsError, match=name):
            replace(toy.WINDOWS, **{name: value})


@pytest.mark.parametrize(("seed", "drive"), [(190, 0), (0, 10_000_000)])
def test_drives_beyond_the_training_seeds_are_refused(
    asked: list[DriveSettings], toy: ModuleType, seed: int, drive: int
) -> None:
    with pytest.raises(SettingsError):
        SimulatedDrives(toy.SMALL, toy.WINDOWS, seed).windows(drive)
    assert asked == []


def test_the_test_set_cannot_be_validated_on(asked: list[DriveSettings], toy: ModuleType) -> None:
    beyond = FIRST_TEST_SEED - FIRST_VALIDATION_SEED
    with pytest.raises(SettingsError):
        ValidationDrives(toy.SMALL, 16.0).windows(beyond)
    assert asked == []


def test_the_same_drive_gives_the_same_windows_and_others_differ(
    asked: list[DriveSettings], toy: ModuleType
) -> None:
    source = SimulatedDrives(toy.SMALL, toy.WINDOWS)
    first, again, other = source.windows(4), source.windows(4), source.windows(5)
    assert all(map(same, first, again))
    assert not any(map(same, first, other))
    assert all(settings.compensated for settings in asked)


def test_windows_are_as_long_as_asked_and_most_begin_at_their_target(toy: ModuleType) -> None:
    settings = replace(
        toy.WINDOWS, lengths=(2, 3, 3), drive_frames=9, windows_per_drive=16, largest_step=2,
        augment=NO_AUGMENTATION,
    )  # fmt: skip
    source = RecordedDrives(("0", "1"), lambda name: toy.CarPark(int(name), 9), toy.SMALL, settings)
    windows = [window for drive in range(5) for window in source.windows(drive)]
    lengths = Counter(len(window.frames) for window in windows)
    assert set(lengths) == {2, 3}
    assert 1.2 < lengths[3] / lengths[2] < 3.3
    steps = {round((window.frames[1].stamp - window.frames[0].stamp) * 10) for window in windows}
    assert steps == {1, 2}
    targets = Counter((window.target, len(window.frames)) for window in windows)
    assert 0.5 < sum(n for (target, _), n in targets.items() if target == 0) / 80 < 0.8
    assert targets[(2, 3)] > targets[(1, 3)] > 0
    for window in windows:
        assert window.target_from_sensor[window.target] == pytest.approx(np.eye(4), abs=1e-9)


def test_a_short_sequence_gives_shorter_windows_and_one_frame_none(toy: ModuleType) -> None:
    source = RecordedDrives(("0",), lambda _: toy.CarPark(0, 2), toy.SMALL, toy.WINDOWS)
    assert {len(window.frames) for window in source.windows(0)} == {2}
    alone = RecordedDrives(("0",), lambda _: toy.CarPark(0, 1), toy.SMALL, toy.WINDOWS)
    with pytest.raises(InputError, match="too few"):
        alone.windows(0)


@pytest.mark.parametrize(
    "wrong",
    [{"lengths": (1, 5)}, {"lengths": ()}, {"lengths": (20,)}, {"windows_per_drive": 0}],
)
def test_settings_that_make_no_window_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(SettingsError):
        WindowSettings(**wrong)


@pytest.mark.parametrize(("longest_s", "most"), [(0.35, 4), (0.1, 2), (0.01, 2), (9.0, 6)])
def test_a_window_spans_no_longer_than_asked(toy: ModuleType, longest_s: float, most: int) -> None:
    settings = replace(toy.WINDOWS, lengths=(6,), longest_s=longest_s, largest_step=1)
    windows = toy.CarParks(settings=settings).windows(0)
    assert {len(window.frames) for window in windows} == {most}
