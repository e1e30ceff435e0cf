"""A street with movers, seen by a driving sensor: boxes on a plane, cast ray by ray."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame, RegistrationQuality
from lidaraccum.geometry import rigid

RATE_HZ = 10.0
SENSOR_HEIGHT_M = 1.8
WALLS = (
    ((-40, 9, 0), (60, 10, 6)),
    ((-40, -12, 0), (5, -11, 5)),
    ((9, -13, 0), (60, -12, 5)),
    ((61, -13, 0), (62, 10, 6)),
)
PARKED = (((6, 5, 0.2), (10, 6.8, 1.6)), ((14, 5, 0.2), (18.2, 6.8, 1.5)))


@dataclass(frozen=True)
class Mover:
    """A box on the street: its lower corner at the first frame, its size, its velocity."""

    low: tuple[float, float, float]
    size: tuple[float, float, float]
    velocity: tuple[float, float, float]
    stops_after_s: float = np.inf

    def place(self, seconds: float) -> np.ndarray:
        """(3,) its lower corner then, metres."""
        return np.array(self.low) + np.array(self.velocity) * min(seconds, self.stops_after_s)


@dataclass(frozen=True)
class SeenStreet:
    """Registered frames and, for each of their points, which mover it is on (from 1; 0 none)."""

    frames: list[RegisteredFrame] = field(default_factory=list)
    on: list[np.ndarray] = field(default_factory=list)


def cast(
    world_from_sensor: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) first hits in sensor coordinates and (N,) the box each lies on, -1 for the ground."""
    elevation = np.radians(np.linspace(-22, 6, 40))
    azimuth = np.radians(np.arange(0, 360, 0.5))
    up, around = np.meshgrid(elevation, azimuth, indexing="ij")
    rays = np.stack(
        [np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1
    ).reshape(-1, 3)
    start = world_from_sensor[:3, 3]
    with np.errstate(divide="ignore"):
        inverse = 1.0 / (rays @ world_from_sensor[:3, :3].T)
    nearest = np.where(inverse[:, 2] < 0, -start[2] * inverse[:, 2], np.inf)
    owner = np.full(len(rays), -1)
    for box in range(len(low)):
        first, second = (low[box] - start) * inverse, (high[box] - start) * inverse
        enter = np.minimum(first, second).max(axis=1)
        hit = (enter <= np.maximum(first, second).min(axis=1)) & (enter > 0) & (enter < nearest)
        nearest[hit], owner[hit] = enter[hit], box
    seen = nearest < 70
    return rays[seen] * nearest[seen, None], owner[seen]


def see(
    movers: Sequence[Mover] = (), count: int = 9, speed: float = 6.0, noise: float = 0.015
) -> SeenStreet:
    """Drive along the street at a speed, m/s, and look ``count`` times."""
    rng = np.random.default_rng(0)
    street = SeenStreet()
    for index in range(count):
        seconds = index / RATE_HZ
        pose = rigid.exponential(np.array([0, 0, 0.01 * index, 0, 0, 0]))
        pose[:3, 3] = [speed * seconds, 0, SENSOR_HEIGHT_M]
        still = np.array(WALLS + PARKED, dtype=np.float64)
        low = np.concatenate(
            [still[:, 0], *(mover.place(seconds)[None] for mover in movers)], dtype=np.float64
        )
        high = np.concatenate(
            [still[:, 1], *(mover.place(seconds)[None] + mover.size for mover in movers)]
        )
        points, owner = cast(pose, low, high)
        noisy = points + rng.normal(0, noise, points.shape)
        frame = Frame(noisy.astype(np.float32), stamp=seconds)
        quality = RegistrationQuality("given", 1.0, 0.0)
        street.frames.append(RegisteredFrame(index, frame, pose, quality))
        street.on.append(np.maximum(owner - len(still) + 1, 0))
    return street


CAR = Mover(low=(14.0, -4.5, 0.15), size=(4.2, 1.8, 1.45), velocity=(-8.0, 0.0, 0.0))
PEDESTRIAN = Mover(low=(9.0, 3.0, 0.0), size=(0.5, 0.5, 1.75), velocity=(0.0, -1.6, 0.0))


@pytest.fixture
def look() -> Callable[..., SeenStreet]:
    """`look(movers, count=9, speed=6, noise=0.015)`: frames of a drive past movers."""
    return see


@pytest.fixture(scope="session")
def busy_street() -> SeenStreet:
    """A car that comes towards the sensor and a pedestrian who crosses."""
    return see([CAR, PEDESTRIAN])


@pytest.fixture
def new_mover() -> type[Mover]:
    """What a mover is made with."""
    return Mover
