"""A street of boxes and a spinning sensor that moves through it, exact to the ray."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid

Array = NDArray[np.float64]

INTERVAL_S = 0.1
FLOOR_Z = -1.7


@dataclass(frozen=True, eq=False)
class Street:
    """Boxes (B, 3) low and high corners, above a flat floor."""

    low: Array
    high: Array

    def first_hit(self, origins: Array, directions: Array) -> Array:
        """Distance (R,) along each ray to what it meets first, inf for nothing."""
        with np.errstate(divide="ignore", invalid="ignore"):
            floor = (FLOOR_Z - origins[:, 2]) / directions[:, 2]
            nearest = np.where(floor > 0, floor, np.inf)
            for low, high in zip(self.low, self.high, strict=True):
                one, two = (low - origins) / directions, (high - origins) / directions
                enter = np.minimum(one, two).max(axis=1)
                leave = np.maximum(one, two).min(axis=1)
                hit = (enter < leave) & (enter > 0)
                nearest = np.where(hit, np.minimum(nearest, enter), nearest)
        return nearest


def street(seed: int = 0, reach: float = 60.0) -> Street:
    """Things of every size on all sides, none on the sensor's way along x or y."""
    random = np.random.default_rng(seed)
    count = 70
    centre = random.uniform(-reach, reach, (count, 2))
    size = np.where(
        random.random((count, 1)) < 0.5,
        random.uniform(0.3, 1.0, (count, 2)),
        random.uniform(2.0, 9.0, (count, 2)),
    )
    height = random.uniform(1.0, 9.0, count)
    clear = (np.abs(centre) > size / 2 + 2.5).all(axis=1)
    centre, size, height = centre[clear], size[clear], height[clear]
    floor = np.full((len(centre), 1), FLOOR_Z)
    return Street(
        np.hstack([centre - size / 2, floor]),
        np.hstack([centre + size / 2, floor + height[:, None]]),
    )


@dataclass(frozen=True)
class Spinner:
    """A sensor with equal steps of azimuth.

    Attributes:
        beams: Rows of the sweep.
        columns: Firings of a turn.
        rolling: Whether a turn takes the whole interval, clockwise from the rear; else no time.
    """

    beams: int = 24
    columns: int = 500
    rolling: bool = False

    def sweep(self, scene: Street, world_from_sensor: rigid.Pose, twist: Array) -> Frame:
        """One frame: stamp in mid-sweep, points as measured, time_offset the truth."""
        part = (np.arange(self.columns) + 0.5) / self.columns - 0.5
        azimuth = -2 * np.pi * part
        elevation = np.deg2rad(np.linspace(-24.0, 8.0, self.beams))
        directions = np.stack(
            [
                np.outer(np.cos(azimuth), np.cos(elevation)),
                np.outer(np.sin(azimuth), np.cos(elevation)),
                np.tile(np.sin(elevation), (self.columns, 1)),
            ],
            axis=2,
        )
        time = part if self.rolling else np.zeros(self.columns)
        poses = world_from_sensor @ rigid.exponentials(twist[None], time)
        world = np.einsum("cij,cbj->cbi", poses[:, :3, :3], directions).reshape(-1, 3)
        origins = np.repeat(poses[:, :3, 3], self.beams, axis=0)
        distance = scene.first_hit(origins, world)
        seen = distance < 80.0
        points = (directions.reshape(-1, 3)[seen] * distance[seen, None]).astype(np.float32)
        offset = np.repeat(time, self.beams)[seen] * INTERVAL_S
        return Frame(points, time_offset=offset.astype(np.float32))


@dataclass(frozen=True, eq=False)
class Drive:
    """Frames of one constant motion, and the truth."""

    frames: list[Frame]
    poses: Array

    @property
    def steps(self) -> Array:
        """(T - 1, 4, 4) true motion from each frame to the next."""
        return rigid.invert(self.poses[:-1]) @ self.poses[1:]


def drive(
    twist: Array | list[float],
    count: int = 5,
    *,
    scene: Street | None = None,
    sensor: Spinner | None = None,
    times: bool = False,
) -> Drive:
    """Move with a constant twist (6,) per frame interval, from the middle of a street."""
    twist = np.asarray(twist, dtype=np.float64)
    scene, sensor = scene or street(), sensor or Spinner()
    poses = rigid.exponentials(twist[None], np.arange(count))
    frames = []
    for index, pose in enumerate(poses):
        swept = sensor.sweep(scene, pose, twist)
        offset = swept.time_offset if times else None
        frames.append(Frame(swept.points, stamp=INTERVAL_S * index, time_offset=offset))
    return Drive(frames, poses)


def shuffled(frame: Frame, seed: int) -> tuple[Frame, NDArray[np.int64]]:
    """The frame with its points in another order, and that order."""
    order = np.random.default_rng(seed).permutation(len(frame))
    return Frame(frame.points[order], stamp=frame.stamp), order


def compensated(moving: Drive, twist: Array, *, times: bool) -> list[Frame]:
    """What a driver that undoes the motion itself would deliver of a rolling drive with times."""
    frames = []
    for frame in moving.frames:
        assert frame.time_offset is not None
        motions = rigid.exponentials(twist[None], frame.time_offset / INTERVAL_S)
        points = np.einsum("nij,nj->ni", motions[:, :3, :3], frame.points) + motions[:, :3, 3]
        offset = frame.time_offset if times else None
        frames.append(Frame(points.astype(np.float32), stamp=frame.stamp, time_offset=offset))
    return frames


class World:
    """All of the above, for tests that need more than one drive."""

    interval_s = INTERVAL_S
    Street = Street
    street = staticmethod(street)
    drive = staticmethod(drive)
    shuffled = staticmethod(shuffled)
    compensated = staticmethod(compensated)
    sensor = Spinner()
    rolling = Spinner(rolling=True)
    dense = Spinner(beams=64, columns=800)


@pytest.fixture(scope="session")
def world() -> World:
    return World()


@pytest.fixture(scope="session")
def straight() -> Drive:
    """Ten metres a second ahead, each sweep at one time."""
    return drive([0, 0, 0, 1.0, 0, 0], count=12)


@pytest.fixture(scope="session")
def rolling() -> Drive:
    """Twelve metres a second and a bend, swept as a real sensor sweeps, with the true times."""
    return drive([0, 0, 0.04, 1.2, 0, 0], count=6, sensor=Spinner(rolling=True), times=True)
