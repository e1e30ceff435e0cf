"""A street in which everything is known.

A vehicle drives past a parked truck, a sign and a building while a car overtakes it and a walker
turns up late. Rays are cast from the vehicle's roof; the boxes in the tables are a tenth larger
than the bodies that the rays meet, so that a point stays inside its box when it is rounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidaraccum.geometry import rigid

ROWS, COLUMNS = 24, 240
INCLINATIONS = np.radians(np.linspace(-20, 6, ROWS))
EPOCH_S = 1_533_151_603
ROOF = np.array([1.4, 0.0, 2.0])
GROUND = 0


def pose(x: float, y: float, z: float, yaw: float) -> np.ndarray:
    """(4, 4), metres and radians."""
    made = rigid.exponential(np.array([0, 0, yaw, 0, 0, 0]))
    made[:3, 3] = [x, y, z]
    return made


@dataclass(frozen=True)
class Thing:
    """What has a box: its words by data set, its size, and a straight way with a constant turn."""

    name: str
    words: dict[str, str]
    size: tuple[float, float, float]
    start: tuple[float, float, float]
    velocity: tuple[float, float] = (0.0, 0.0)
    turn: float = 0.0
    drawn_from: float = 0.0

    def at(self, seconds: float) -> np.ndarray:
        """world_from_box (4, 4)."""
        x, y, yaw = self.start
        x, y = x + self.velocity[0] * seconds, y + self.velocity[1] * seconds
        return pose(1000 + x, 500 + y, 0.05 + self.size[2] / 2, yaw + self.turn * seconds)

    @property
    def movable(self) -> bool:
        """Whether a converter should take it for foreground."""
        return self.name != "sign"


def _words(nuscenes: str, waymo: str, argoverse2: str) -> dict[str, str]:
    return {"nuscenes": nuscenes, "waymo": waymo, "argoverse2": argoverse2}


THINGS = (
    Thing(
        "mover",
        _words("vehicle.car", "1", "REGULAR_VEHICLE"),
        (4.6, 2.0, 1.7),
        (9.0, -5.0, 0.1),
        velocity=(8.0, 0.5),
        turn=0.2,
    ),
    Thing("parked", _words("vehicle.truck", "1", "BOX_TRUCK"), (6.0, 2.3, 2.6), (14.0, 6.0, 0.05)),
    Thing(
        "walker",
        _words("human.pedestrian.adult", "2", "PEDESTRIAN"),
        (0.8, 0.8, 1.8),
        (12.0, 2.5, 1.0),
        velocity=(0.0, 1.4),
        drawn_from=0.2,
    ),
    Thing(
        "sign",
        _words("movable_object.barrier", "3", "STOP_SIGN"),
        (1.0, 1.0, 2.4),
        (8.0, 4.0, 0.0),
    ),
)
MOVER, PARKED, WALKER, SIGN = range(1, 5)
BUILDING = Thing("building", {}, (80.0, 4.0, 9.0), (10.0, 14.0, 0.0))


def vehicle_at(seconds: float) -> np.ndarray:
    """world_from_vehicle (4, 4): rear axle on the ground, x ahead."""
    return pose(1000 + 5.0 * seconds, 500 + 0.2 * seconds, 0.0, 0.06 * seconds)


@dataclass(frozen=True)
class Cast:
    """One sweep. ``points`` (N, 3) world metres, ``owner`` (N,): 0 or a place in THINGS from 1."""

    points: np.ndarray
    owner: np.ndarray
    row: np.ndarray
    column: np.ndarray
    distance: np.ndarray

    @property
    def in_no_label_zone(self) -> np.ndarray:
        """(N,) bool: in the quarter of the sweep from the right to behind."""
        return self.column > COLUMNS * 3 // 4

    def seen_from(self, world_from_frame: np.ndarray) -> np.ndarray:
        """Points (N, 3) in a frame's coordinates."""
        return rigid.transform(rigid.invert(world_from_frame), self.points)


def column_times(seconds: float, sweep_s: float) -> np.ndarray:
    """When each column is measured (COLUMNS,), about ``seconds``."""
    return seconds + sweep_s * ((np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5)


def cast(seconds: float, sweep_s: float = 0.0) -> Cast:
    """Rays from the roof, column by column from straight behind, clockwise; things stand still."""
    azimuth = np.pi - 2 * np.pi * (np.arange(COLUMNS) + 0.5) / COLUMNS
    up, around = np.meshgrid(INCLINATIONS[::-1], azimuth, indexing="ij")
    rays = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], -1)
    vehicles = np.stack([vehicle_at(time) for time in column_times(seconds, sweep_s)])
    start = (vehicles[:, :3, :3] @ ROOF + vehicles[:, :3, 3])[None].repeat(ROWS, axis=0)
    rays = np.einsum("cij,rcj->rci", vehicles[:, :3, :3], rays)
    start, rays = start.reshape(-1, 3), rays.reshape(-1, 3)
    with np.errstate(divide="ignore"):
        distance = np.where(rays[:, 2] < 0, -start[:, 2] / rays[:, 2], np.inf)
    owner = np.zeros(len(rays), dtype=int)
    for number, thing in enumerate((*THINGS, BUILDING), start=1):
        met = _meet(start, rays, thing.at(seconds), 0.9 * np.array(thing.size))
        nearer = met < distance
        distance[nearer] = met[nearer]
        owner[nearer] = number if number <= len(THINGS) else GROUND
    back = np.flatnonzero(distance < 45)
    points = start[back] + distance[back, None] * rays[back]
    return Cast(points, owner[back], back // COLUMNS, back % COLUMNS, distance[back])


def _meet(start: np.ndarray, rays: np.ndarray, box: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Distance (N,) to a box along rays; infinite where they miss it."""
    local = rigid.transform(rigid.invert(box), start)
    along = rays @ box[:3, :3]
    with np.errstate(divide="ignore"):
        first, second = (-size / 2 - local) / along, (size / 2 - local) / along
    enter = np.minimum(first, second).max(axis=1)
    leave = np.maximum(first, second).min(axis=1)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)


@dataclass(frozen=True)
class Written:
    """A data set on disk. ``drawn`` are the places of the sweeps with boxes."""

    kind: str
    root: Path
    name: str
    seconds: np.ndarray
    frame_from_vehicle: np.ndarray
    drawn: tuple[int, ...]
    sweep_s: float = 0.0

    def world_from_frame(self, index: int) -> np.ndarray:
        """The true pose (4, 4) of a sweep."""
        return vehicle_at(self.seconds[index]) @ rigid.invert(self.frame_from_vehicle)

    def truth(self, index: int) -> Cast:
        """What a sweep was made of, in the order of the file."""
        return cast(self.seconds[index], self.sweep_s)


def quaternion(motion: np.ndarray) -> list[float]:
    """w, x, y, z of a turn about z."""
    yaw = np.arctan2(motion[1, 0], motion[0, 0])
    return [float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))]
