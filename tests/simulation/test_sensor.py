"""Sensors are as their data sheets say, and their frames show it."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.errors import SettingsError
from lidaraccum.simulation.drive import DriveSettings, simulate
from lidaraccum.simulation.sensor import RANDOM_SENSOR, SENSORS, random_sensor, sensor_by_name

DATA_SHEETS = {
    "HDL-64E": (64, -24.33, 2.0, 2083),
    "HDL-32E": (32, -30.67, 10.67, 2170),
    "VLP-16": (16, -15.0, 15.0, 1808),
    "VLP-32C": (32, -25.0, 15.0, 1808),
    "VLP-32C-pair": (64, -25.0, 25.0, 1808),
    "Pandar64": (64, -24.897, 14.882, 1800),
    "OS1-64": (64, -16.6, 16.6, 1024),
    "OS1-128": (128, -22.5, 22.5, 1024),
    "Waymo-like-64": (64, -17.6, 2.4, 2650),
}
"""Beams, lowest and highest elevation in degrees, firings a turn at 10 Hz."""


def test_every_sensor_has_its_data_sheet_here() -> None:
    assert set(SENSORS) == set(DATA_SHEETS)


@pytest.mark.parametrize("name", SENSORS)
def test_beams_are_as_the_data_sheet_says(name: str) -> None:
    sensor = SENSORS[name]()
    beams, lowest, highest, columns = DATA_SHEETS[name]
    assert sensor.beams == beams
    assert len(sensor.azimuth) == len(sensor.height) == beams
    assert np.rad2deg(sensor.elevation[[0, -1]]) == pytest.approx([lowest, highest], abs=0.01)
    assert (np.diff(sensor.elevation) >= 0).all()
    assert sensor.columns_at(10.0) == columns


@pytest.mark.parametrize("name", SENSORS)
def test_a_frame_has_every_beam_at_its_angle(name: str) -> None:
    settings = DriveSettings(
        seed=3, frames=1, sensor=name, rate_hz=10.0, scene="tunnel", speed_mps=0.0,
        coordinates="sensor", rolling_shutter=False, zeros=True, exact=True,
    )  # fmt: skip
    drive = simulate(settings)
    frame, sensor = drive[0], drive.drawn.sensor
    beams, _, _, columns = DATA_SHEETS[name]
    assert len(frame) == beams * columns
    assert np.array_equal(np.bincount(frame.ring), np.full(beams, columns))
    back = frame.returned
    points = frame.points[back].astype(np.float64)
    points[:, 2] -= sensor.height[frame.ring[back]]
    elevation = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    assert np.abs(elevation - sensor.elevation[frame.ring[back]]).max() < 1e-4


def test_random_sensors_differ_and_keep_bounds() -> None:
    drawn = [random_sensor(np.random.default_rng(seed)) for seed in range(30)]
    assert len({sensor.beams for sensor in drawn}) > 4
    for sensor in drawn:
        assert 16 <= sensor.beams <= 128
        assert (np.diff(sensor.elevation) > 0).all()
        assert np.deg2rad(-33) < sensor.elevation[0] < sensor.elevation[-1] < np.deg2rad(21)
        assert sensor.beams * sensor.columns <= 240_000


def test_unknown_sensors_are_refused() -> None:
    with pytest.raises(SettingsError, match="no sensor is called"):
        sensor_by_name("HDL-65", np.random.default_rng(0))
    assert sensor_by_name(RANDOM_SENSOR, np.random.default_rng(0)).name == RANDOM_SENSOR
