"""How exact poses are where nothing hinders them: the noise of few points must not show in them."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.registration.odometry import register
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.settings import DriveSettings


@pytest.mark.parametrize("sensor", ["HDL-64E", "OS1-128", "VLP-32C"])
def test_a_sensor_that_stands_is_found_where_it_stands(sensor: str) -> None:
    """To a tenth of what one point's noise is."""
    settings = DriveSettings(
        seed=1, frames=3, sensor=sensor, speed_mps=0.0, manoeuvre="stand", weather="clear"
    )
    drive = simulate(settings)
    found = list(register(drive[index] for index in range(3)))
    back = rigid.invert(found[0].world_from_sensor)
    for one in found[1:]:
        assert np.linalg.norm((back @ one.world_from_sensor)[:3, 3]) < 0.002
