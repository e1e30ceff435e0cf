"""What to simulate, and what the seed decides where that is left open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidaraccum.errors import SettingsError
from lidaraccum.simulation.motion import MANOEUVRES
from lidaraccum.simulation.networks import SCENE_KINDS, draw_kind
from lidaraccum.simulation.returns import IDEAL, Realism, draw_weather
from lidaraccum.simulation.sensor import RANDOM_SENSOR, SENSORS, Sensor, sensor_by_name

WEATHERS = ("clear", "rain", "fog", "snow")


@dataclass(frozen=True)
class DriveSettings:
    """What to simulate; whatever is None is drawn from the seed.

    Attributes:
        seed: 0 or more. The same settings give the same bytes.
        frames: How many.
        sensor: A name in ``SENSORS``, or ``random``.
        rate_hz: Turns a second.
        scene: One of ``SCENE_KINDS``.
        speed_mps: The ego's speed at the start (bends may keep it lower).
        manoeuvre: One of ``MANOEUVRES``: what the ego does with its speed.
        rolling_shutter: Each column measured at its own time, from where the sensor is then;
            otherwise all at the stamp.
        compensated: Points of a rolling shutter moved to the stamp by the true ego-motion, as
            data sets deliver them (movers stay smeared by their own motion).
        coordinates: ``sensor``, or ``vehicle``: on the ground under the car.
        weather: clear, rain, fog or snow.
        zeros: Whether pulses that never came back are delivered as points at 0, 0, 0.
        rare: Lorries, buses, vans, trailers, things on two wheels, oddities (all that is movable
            but cars and people on foot) are so many times as likely as usual where one is drawn.
        green: So many times as much as drawn stands about properties (what grows from the ground,
            lines across, cars near it), up to the most that is ever drawn; nothing at 0.
        dense: Share of hedges, bushes and low crowns that is closed outside, as most of what is
            recorded is; the others are leaves about a core.
        beside: So many large things, movable or not, stand within 2.5 m of the ego's body on every
            20 m of its way, on average, besides what a street has.
        beam_bias: The ranges of a sensor's beams are off by up to so many times as much as its
            data sheet would have it; drawn.
        furniture: Whether signs, bins, kiosks, containers, statues and the like stand about.
        exact: Without noise, losses, mixed edges or weather; for tests of laws.
    """

    seed: int = 0
    frames: int = 5
    sensor: str | None = None
    rate_hz: float | None = None
    scene: str | None = None
    speed_mps: float | None = None
    manoeuvre: str | None = None
    rolling_shutter: bool | None = None
    compensated: bool | None = None
    coordinates: Literal["sensor", "vehicle"] | None = None
    weather: str | None = None
    zeros: bool | None = None
    rare: float = 1.0
    green: float = 1.0
    dense: float = 0.0
    beside: float = 0.0
    beam_bias: float = 1.0
    furniture: bool = True
    exact: bool = False

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise SettingsError(f"a seed is 0 or more, not {self.seed}")
        if self.frames < 1:
            raise SettingsError(f"a drive has one frame or more, not {self.frames}")
        if self.rate_hz is not None and not 1.0 <= self.rate_hz <= 50.0:
            raise SettingsError(f"a sensor turns 1 to 50 times a second, not {self.rate_hz}")
        if self.speed_mps is not None and not 0.0 <= self.speed_mps <= 45.0:
            raise SettingsError(f"the ego drives 0 to 45 m/s, not {self.speed_mps}")
        for told, fits in (
            (f"rare is a factor above 0, not {self.rare}", self.rare > 0.0),
            (f"green is a factor of 0 or more, not {self.green}", self.green >= 0.0),
            (f"dense is a share, 0 to 1, not {self.dense}", 0.0 <= self.dense <= 1.0),
            (f"beside is a number of 0 or more, not {self.beside}", self.beside >= 0.0),
            (f"beam_bias is a factor of 1 or more, not {self.beam_bias}", self.beam_bias >= 1.0),
        ):
            if not fits:
                raise SettingsError(told)
        for word, value, known in (
            ("sensor", self.sensor, (*SENSORS, RANDOM_SENSOR)),
            ("scene", self.scene, SCENE_KINDS),
            ("manoeuvre", self.manoeuvre, MANOEUVRES),
            ("weather", self.weather, WEATHERS),
            ("coordinates", self.coordinates, ("sensor", "vehicle")),
        ):
            if value is not None and value not in known:
                raise SettingsError(
                    f"no {word} is called {value!r}", hint=f"known: {', '.join(known)}"
                )


@dataclass(frozen=True)
class DrawnDrive:
    """Settings with nothing left open, and what follows from them."""

    sensor: Sensor
    rate_hz: float
    scene: str
    speed_mps: float
    manoeuvre: str
    rolling_shutter: bool
    compensated: bool
    vehicle_coordinates: bool
    zeros: bool
    beam_bias: float
    realism: Realism


def draw_drive(settings: DriveSettings) -> DrawnDrive:
    """Fill in what the settings leave open. What is drawn does not depend on what is given."""
    rng = np.random.default_rng([settings.seed, 1])
    children = [child(rng) for _ in range(6)]
    chance = rng.random(8)
    sensor_name = settings.sensor or _pick(chance[0], [*SENSORS, *[RANDOM_SENSOR] * 4])
    sensor = sensor_by_name(sensor_name, children[0])
    rate = settings.rate_hz or float(children[1].choice(sensor.rates_hz))
    drawn_speed = _draw_speed(children[2])
    speed = drawn_speed if settings.speed_mps is None else settings.speed_mps
    scene = settings.scene or draw_kind(speed, children[3])
    manoeuvre = settings.manoeuvre or _draw_manoeuvre(speed, children[4])
    rolling = _either(settings.rolling_shutter, chance[1] < 0.85)
    compensated = _either(settings.compensated, chance[2] < 0.5) and rolling
    vehicle = (settings.coordinates or ("vehicle" if chance[3] < 0.2 else "sensor")) == "vehicle"
    zeros = _either(settings.zeros, chance[4] < 0.12)
    weather = settings.weather or _pick(chance[5], ["clear"] * 16 + ["rain", "rain", "fog", "snow"])
    realism = _draw_realism(weather, children[5])
    worse = np.random.default_rng([settings.seed, 4])
    beam_bias = float(worse.uniform(1.0, settings.beam_bias))
    return DrawnDrive(
        sensor, rate, scene, speed, manoeuvre, rolling, compensated, vehicle,
        zeros, beam_bias, IDEAL if settings.exact else realism,
    )  # fmt: skip


def child(rng: np.random.Generator) -> np.random.Generator:
    """A generator of its own, so that what one part draws does not shift the next."""
    return np.random.default_rng(rng.integers(2**63))


def _pick(chance: float, names: list[str]) -> str:
    return names[int(chance * len(names))]


def _either(given: bool | None, drawn: bool) -> bool:
    return bool(drawn) if given is None else given


def _draw_speed(rng: np.random.Generator) -> float:
    """0 to 30 m/s: standing, town, main road, motorway."""
    low, high = ((0, 0), (0.5, 9), (7, 15), (15, 22), (22, 30))[
        int(rng.choice(5, p=[0.15, 0.3, 0.35, 0.12, 0.08]))
    ]
    return float(rng.uniform(low, high))


def _draw_manoeuvre(speed: float, rng: np.random.Generator) -> str:
    if speed < 0.2:
        return str(rng.choice(["stand", "pull away"], p=[0.8, 0.2]))
    return str(rng.choice(["cruise", "brake", "accelerate"], p=[0.7, 0.16, 0.14]))


def _draw_realism(weather: str, rng: np.random.Generator) -> Realism:
    return Realism(
        noise=float(rng.uniform(0.5, 1.4)),
        drop=float(rng.choice([0.002, 0.01, 0.03])),
        mixed=float(rng.uniform(0.02, 0.15)),
        weather=draw_weather(weather, rng),
    )
