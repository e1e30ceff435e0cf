"""Settings are checked, and what is given does not change what else is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from lidaraccum.errors import SettingsError
from lidaraccum.simulation.settings import DriveSettings, draw_drive


@pytest.mark.parametrize(
    "wrong",
    [
        {"seed": -1}, {"frames": 0}, {"rate_hz": 0.0}, {"speed_mps": 99.0}, {"sensor": "none"},
        {"scene": "moon"}, {"manoeuvre": "fly"}, {"weather": "hail"}, {"coordinates": "world"},
        {"dense": -0.1}, {"dense": 1.1}, {"beside": -0.1}, {"beam_bias": 0.9},
    ],
    ids=str,
)  # fmt: skip
def test_senseless_settings_are_refused(wrong: Mapping[str, Any]) -> None:
    with pytest.raises(SettingsError):
        DriveSettings(**wrong)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_given_leaves_the_other_draws_alone(seed: int) -> None:
    free = draw_drive(DriveSettings(seed=seed))
    fixed = draw_drive(DriveSettings(seed=seed, sensor=free.sensor.name, weather="clear"))
    for name in ("rate_hz", "scene", "speed_mps", "manoeuvre", "rolling_shutter", "zeros"):
        assert getattr(free, name) == getattr(fixed, name)


def test_seeds_reach_every_sensor_scene_and_weather() -> None:
    drawn = [draw_drive(DriveSettings(seed=seed)) for seed in range(400)]
    assert len({one.sensor.name for one in drawn}) == 10
    assert len({one.scene for one in drawn}) == 11
    assert {one.realism.weather.name for one in drawn} == {"clear", "rain", "fog", "snow"}
    assert min(one.speed_mps for one in drawn) == 0.0
    assert max(one.speed_mps for one in drawn) > 25.0
