"""Training and testing never meet."""

from __future__ import annotations

import pytest

from lidaraccum.errors import SettingsError
from lidaraccum.simulation.sensor import RANDOM_SENSOR, SENSORS
from lidaraccum.simulation.windows import (
    FIRST_TEST_SEED,
    TEST_SPEEDS_MPS,
    TEST_WINDOWS,
    held_out_numbers,
    held_out_settings,
    held_out_windows,
    training_settings,
)


def test_the_test_set_has_200_windows_over_all_sensors_and_speeds() -> None:
    windows = [held_out_settings(index) for index in range(TEST_WINDOWS)]
    assert len({window.seed for window in windows}) == TEST_WINDOWS == 200
    met = {(window.sensor, window.speed_mps) for window in windows}
    assert met == {(name, v) for name in (*SENSORS, RANDOM_SENSOR) for v in TEST_SPEEDS_MPS}


def test_training_seeds_lie_below_all_test_seeds() -> None:
    assert training_settings(FIRST_TEST_SEED - 1).seed < held_out_settings(0).seed
    for index in (-1, FIRST_TEST_SEED):
        with pytest.raises(SettingsError, match="training seeds"):
            training_settings(index)
    for index in (-1, TEST_WINDOWS):
        with pytest.raises(SettingsError, match="test set"):
            held_out_settings(index)


def test_a_sample_of_the_test_set_has_every_sensor_as_often_and_every_speed() -> None:
    assert len(set(held_out_numbers(TEST_WINDOWS))) == TEST_WINDOWS
    sample = [held_out_settings(number) for number in held_out_numbers(40)]
    sensors = [window.sensor for window in sample]
    assert {sensors.count(name) for name in (*SENSORS, RANDOM_SENSOR)} == {4}
    assert {window.speed_mps for window in sample} == set(TEST_SPEEDS_MPS)
    for count in (0, TEST_WINDOWS + 1):
        with pytest.raises(SettingsError, match="test set"):
            held_out_numbers(count)


def test_windows_are_made_when_asked_for() -> None:
    first = next(held_out_windows())
    assert first.settings == held_out_settings(0)
    assert len(first) == 5
