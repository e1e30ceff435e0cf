"""Few things stand there, and the ground's rings travel with the sensor: they fix no motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.registration.odometry import register
from lidaraccum.simulation.drive import SimulatedSequence, simulate
from lidaraccum.simulation.settings import DriveSettings

FRAMES = 4
HIGHWAY = DriveSettings(
    frames=FRAMES, sensor="HDL-32E", scene="highway", speed_mps=28.0, rate_hz=20.0,
    rolling_shutter=False, weather="clear", manoeuvre="cruise",
)  # fmt: skip


def last_error_m(drive: SimulatedSequence) -> tuple[float, bool]:
    """How far off the last frame is, and whether sweeps were taken for as measured."""
    truth = [drive.labels(index).world_from_sensor for index in (0, FRAMES - 1)]
    found = list(register(drive[index] for index in range(FRAMES)))
    error = rigid.invert(rigid.invert(truth[0]) @ truth[1]) @ found[-1].world_from_sensor
    return float(np.linalg.norm(error[:3, 3])), found[-1].deskewed


@pytest.mark.parametrize("seed", [3, 6])
def test_a_start_at_speed_on_a_highway_is_no_standing_still(seed: int) -> None:
    error_m, _ = last_error_m(simulate(replace(HIGHWAY, seed=seed)))
    assert error_m < 0.15


def test_a_compensated_sweep_of_two_stacked_sensors_is_left_as_it_is() -> None:
    """Its times are in the file, and the steps of its beams say nothing of what was done."""
    drive = simulate(
        DriveSettings(
            seed=4, frames=FRAMES, sensor="VLP-32C-pair", scene="suburban", speed_mps=14.0,
            rate_hz=10.0, rolling_shutter=True, compensated=True, coordinates="sensor",
            weather="clear", manoeuvre="cruise",
        )
    )  # fmt: skip
    error_m, deskewed = last_error_m(drive)
    assert not deskewed
    assert error_m < 0.05
