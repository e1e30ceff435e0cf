"""Spinning sensors by name, from their data sheets, and random ones by seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import SettingsError


@dataclass(frozen=True, eq=False)
class Sensor:
    """A spinning sensor: every beam fires once in every column.

    Attributes:
        name: As in ``SENSORS``.
        elevation: (B,) float64 radians above the horizon, lowest beam (ring 0) first.
        azimuth: (B,) float64 radians each beam is turned about z against its column.
        height: (B,) float64 metres each beam starts above the sensor's origin.
        columns_per_second: Firings a second, or 0 when ``columns`` is the same at every rate.
        columns: Firings a turn when it does not depend on the rate.
        rates_hz: Turns a second it is run at.
        range_m: Longest range on a target of 10 % reflectivity (bright ones are seen further).
        max_range_m: Range at which the sensor stops listening.
        min_range_m: Shortest range.
        range_noise_m: One sigma of a range.
        beam_bias_m: One sigma of what each beam's range is off by, always.
        clockwise: Seen from above.
    """

    name: str
    elevation: NDArray[np.float64]
    azimuth: NDArray[np.float64]
    height: NDArray[np.float64]
    columns_per_second: float = 0.0
    columns: int = 0
    rates_hz: tuple[float, ...] = (10.0,)
    range_m: float = 60.0
    max_range_m: float = 120.0
    min_range_m: float = 0.9
    range_noise_m: float = 0.015
    beam_bias_m: float = 0.008
    clockwise: bool = True

    @property
    def beams(self) -> int:
        """Number of beams."""
        return len(self.elevation)

    def columns_at(self, rate_hz: float) -> int:
        """Firings in one turn at a rate in turns a second."""
        return self.columns or int(self.columns_per_second / rate_hz)

    def directions(self) -> NDArray[np.float64]:
        """(B, 3) unit vectors of the beams in a column that points along x."""
        flat = np.cos(self.elevation)
        return np.stack(
            [flat * np.cos(self.azimuth), flat * np.sin(self.azimuth), np.sin(self.elevation)],
            axis=1,
        )


def _of_degrees(name: str, elevation: NDArray[Any]) -> Sensor:
    ordered = np.deg2rad(np.sort(np.asarray(elevation, dtype=np.float64)))
    zeros = np.zeros(len(ordered))
    return Sensor(name, ordered, zeros, zeros)


def _hdl_64e() -> Sensor:
    upper, lower = 2.0 - np.arange(32) / 3.0, -8.83 - 0.5 * np.arange(32)
    base = _of_degrees("HDL-64E", np.concatenate([upper, lower]))
    return replace(
        base, columns_per_second=20833.0, rates_hz=(10.0, 5.0, 15.0), range_m=55.0,
        range_noise_m=0.02, beam_bias_m=0.015,
    )  # fmt: skip


def _hdl_32e() -> Sensor:
    base = _of_degrees("HDL-32E", 10.67 - np.arange(32) * (41.34 / 31))
    return replace(
        base, columns_per_second=21701.0, rates_hz=(10.0, 20.0), range_m=50.0, max_range_m=100.0,
        range_noise_m=0.02, min_range_m=0.8,
    )  # fmt: skip


def _vlp_16() -> Sensor:
    base = _of_degrees("VLP-16", np.linspace(-15, 15, 16))
    return replace(
        base, columns_per_second=18084.0, rates_hz=(10.0, 5.0, 20.0), range_m=50.0,
        max_range_m=100.0, min_range_m=0.5,
    )  # fmt: skip


_VLP_32C_DEG = (
    -25, -15.639, -11.31, -8.843, -7.254, -6.148, -5.333, -4.667, -4, -3.667, -3.333, -3, -2.667,
    -2.333, -2, -1.667, -1.333, -1, -0.667, -0.333, 0, 0.333, 0.667, 1, 1.333, 1.667, 2.333, 3.333,
    4.667, 7, 10.333, 15,
)  # fmt: skip
_VLP_32C_AZIMUTH_DEG = (1.4, -4.2, 1.4, -1.4, 1.4, -1.4, 4.2, -1.4)


def _vlp_32c() -> Sensor:
    base = _of_degrees("VLP-32C", np.array(_VLP_32C_DEG))
    return replace(
        base, azimuth=np.deg2rad(np.tile(_VLP_32C_AZIMUTH_DEG, 4)), columns_per_second=18084.0,
        rates_hz=(10.0, 5.0, 20.0), range_m=80.0, max_range_m=200.0, min_range_m=0.5,
    )  # fmt: skip


def _vlp_32c_pair() -> Sensor:
    """Two VLP-32C, one above the other upside down, half a turn apart."""
    one = _vlp_32c()
    elevation = np.concatenate([one.elevation, -one.elevation])
    azimuth = np.concatenate([one.azimuth, np.pi - one.azimuth])
    height = np.concatenate([np.full(32, 0.09), np.full(32, -0.09)])
    order = np.argsort(elevation, kind="stable")
    return replace(
        one, name="VLP-32C-pair", elevation=elevation[order], azimuth=azimuth[order],
        height=height[order], rates_hz=(10.0,),
    )  # fmt: skip


_PANDAR64_DEG = (
    14.882, 11.032, 8.059, 5.057, 3.04, 2.028, 1.86, 1.688, 1.522, 1.351, 1.184, 1.013, 0.846,
    0.675, 0.508, 0.337, 0.169, 0, -0.169, -0.337, -0.508, -0.675, -0.845, -1.013, -1.184, -1.351,
    -1.522, -1.688, -1.86, -2.028, -2.198, -2.365, -2.536, -2.7, -2.873, -3.04, -3.21, -3.375,
    -3.548, -3.712, -3.884, -4.05, -4.221, -4.385, -4.558, -4.72, -4.892, -5.057, -5.229, -5.391,
    -5.565, -5.726, -5.898, -6.061, -7.063, -8.059, -9.06, -9.885, -11.032, -12.006, -12.974,
    -13.93, -18.889, -24.897,
)  # fmt: skip


def _pandar64() -> Sensor:
    base = _of_degrees("Pandar64", np.array(_PANDAR64_DEG))
    return replace(
        base, columns_per_second=18000.0, rates_hz=(10.0, 20.0), range_m=100.0, max_range_m=200.0,
        azimuth=np.deg2rad(np.tile([-1.042, 1.042, 3.125, -3.125], 16)), min_range_m=0.3,
    )  # fmt: skip


def _ouster(beams: int, half_angle: float, columns: int) -> Sensor:
    base = _of_degrees(f"OS1-{beams}", np.linspace(-half_angle, half_angle, beams))
    return replace(
        base, columns=columns, rates_hz=(10.0, 20.0), range_m=45.0, max_range_m=120.0,
        azimuth=np.deg2rad(np.tile([-3.1, -1.0, 1.0, 3.1], beams // 4)), min_range_m=0.3,
        range_noise_m=0.01, beam_bias_m=0.003,
    )  # fmt: skip


def _waymo_like() -> Sensor:
    """64 beams from -17.6 to +2.4 degrees, twice as dense at the horizon as at the ground."""
    steps = np.linspace(0.45, 0.17, 63)
    fan = np.concatenate([[0.0], np.cumsum(steps)])
    base = _of_degrees("Waymo-like-64", -17.6 + fan * (20.0 / fan[-1]))
    return replace(
        base, columns=2650, range_m=60.0, max_range_m=75.0, range_noise_m=0.01, beam_bias_m=0.003
    )


SENSORS: dict[str, Callable[[], Sensor]] = {
    "HDL-64E": _hdl_64e,
    "HDL-32E": _hdl_32e,
    "VLP-16": _vlp_16,
    "VLP-32C": _vlp_32c,
    "VLP-32C-pair": _vlp_32c_pair,
    "Pandar64": _pandar64,
    "OS1-64": lambda: _ouster(64, 16.6, 1024),
    "OS1-128": lambda: _ouster(128, 22.5, 1024),
    "Waymo-like-64": _waymo_like,
}
"""Sensors by name."""

RANDOM_SENSOR = "random"
"""The name that asks for a sensor no one sells, drawn by seed."""


def sensor_by_name(name: str, rng: np.random.Generator) -> Sensor:
    """The sensor called ``name``, or one drawn from ``rng`` when it is ``random``.

    Raises:
        SettingsError: When no sensor is called so.
    """
    if name == RANDOM_SENSOR:
        return random_sensor(rng)
    if name not in SENSORS:
        known = ", ".join([*SENSORS, RANDOM_SENSOR])
        raise SettingsError(f"no sensor is called {name!r}", hint=f"known: {known}")
    return SENSORS[name]()


def random_sensor(rng: np.random.Generator) -> Sensor:
    """A sensor that does not exist: other beams, spacing, turns, ranges and noise."""
    beams = int(rng.choice([16, 20, 24, 32, 40, 48, 64, 80, 128]))
    lowest, highest = rng.uniform(-32, -14), rng.uniform(1.5, 20)
    weights = 1 + rng.uniform(0, 3) * np.linspace(-1, 1, beams - 1) ** 2
    weights *= rng.uniform(0.9, 1.1, beams - 1)
    fan = np.concatenate([[0.0], np.cumsum(weights)])
    base = _of_degrees(RANDOM_SENSOR, lowest + fan * ((highest - lowest) / fan[-1]))
    reach = float(rng.uniform(30, 100))
    staggered = rng.uniform(0, 5) * rng.uniform(-1, 1, beams) * (rng.random() < 0.5)
    return replace(
        base,
        azimuth=np.deg2rad(staggered),
        columns=int(rng.integers(900, min(2400, 230_000 // beams) + 1)),
        rates_hz=(5.0, 10.0, 12.5, 20.0),
        range_m=reach,
        max_range_m=reach * float(rng.uniform(1.2, 2.2)),
        min_range_m=float(rng.uniform(0.2, 1.5)),
        range_noise_m=float(rng.uniform(0.004, 0.035)),
        beam_bias_m=float(rng.uniform(0.0, 0.02)),
        clockwise=bool(rng.random() < 0.7),
    )
