"""Where the sensor was is told by what it saw."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry.viewpoint import find_viewpoint
from lidaraccum.simulation.drive import SimulatedSequence, simulate
from lidaraccum.simulation.settings import DriveSettings

SENSORS = ("HDL-64E", "HDL-32E", "OS1-64")


def drive(sensor: str, coordinates: str, seed: int) -> SimulatedSequence:
    return simulate(
        DriveSettings(
            seed=seed, frames=1, sensor=sensor, scene="suburban", speed_mps=8.0,
            coordinates=coordinates, weather="clear",  # type: ignore[arg-type]
        )
    )  # fmt: skip


@pytest.mark.parametrize("sensor", SENSORS)
def test_above_coordinates_that_start_on_the_road_the_sensor_is_found(sensor: str) -> None:
    for seed in (1, 2, 3):
        seen = drive(sensor, "vehicle", seed)
        mount = seen.ego.vehicle_from_sensor[:3, 3]
        assert np.linalg.norm(find_viewpoint(seen[0].points) - mount) < 0.8 < mount[2]


@pytest.mark.parametrize("sensor", SENSORS)
def test_sensor_coordinates_start_at_the_sensor(sensor: str) -> None:
    for seed in (1, 2, 3):
        np.testing.assert_array_equal(find_viewpoint(drive(sensor, "sensor", seed)[0].points), 0.0)


def test_no_points_no_guess() -> None:
    np.testing.assert_array_equal(find_viewpoint(np.zeros((0, 3), dtype=np.float32)), 0.0)
    np.testing.assert_array_equal(find_viewpoint(np.zeros((9, 3), dtype=np.float32)), 0.0)
