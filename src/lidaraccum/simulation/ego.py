"""The car that carries the sensor: its way, its swaying body, the mount and its own roof."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.cars import draw_car
from lidaraccum.simulation.mesh import Mesh, empty
from lidaraccum.simulation.motion import Trajectory, distance_of, poses_of, sample_times
from lidaraccum.simulation.roads import Path
from lidaraccum.simulation.terrain import Terrain, attitude, corners_of

Array = NDArray[np.float64]
WHEELS_M = (2.7, 1.6)
"""Wheelbase and track."""


@dataclass(frozen=True, eq=False)
class Ego:
    """The sensor's carrier.

    Attributes:
        trajectory: world_from_vehicle; the vehicle's origin lies on the ground under its middle.
        vehicle_from_sensor: (4, 4) the mount.
        speeds: (K,) m/s at the trajectory's times.
        body: What of the car the sensor can see, in vehicle coordinates; may be empty.
        body_removed: Whether returns of the own car are taken out (as too near), which leaves a
            hole where it hides the street.
    """

    trajectory: Trajectory
    vehicle_from_sensor: Array
    speeds: Array
    body: Mesh
    body_removed: bool = False


def draw_mount(rng: np.random.Generator) -> Array:
    """vehicle_from_sensor: 1.4 to 2.6 m up, nearly level, mostly looking ahead."""
    height = float(np.clip(rng.normal(1.85, 0.22), 1.4, 2.6))
    yaw = float(rng.choice([0.0, 0.5 * np.pi, -0.5 * np.pi, np.pi], p=[0.84, 0.07, 0.06, 0.03]))
    tilt = np.deg2rad(rng.normal(0, 0.6, 3))
    angles = np.array([[yaw + tilt[0], tilt[1], tilt[2]]])
    return poses_of(np.array([[rng.uniform(-0.6, 0.6), rng.normal(0, 0.05), height]]), angles)[0]


def draw_body(mount: Array, rng: np.random.Generator) -> Mesh:
    """The own car under the sensor, with the mount's rack; none where the roof is out of view."""
    if rng.random() < 0.35:
        return empty()
    car = draw_car(rng, str(rng.choice(["estate", "suv", "hatchback", "mpv"])))
    roof = mount[2, 3] - rng.uniform(0.12, 0.6)
    return car.mesh.moved((0, 0, 0), 0.0, (1.0, 1.0, float(roof / car.size_lwh[2])))


def drive_ego(
    path: Path, start: float, speeds: Array, duration_s: float, terrain: Terrain,
    rng: np.random.Generator,
) -> Trajectory:  # fmt: skip
    """The vehicle's motion along its path at given speeds, on the ground, swaying.

    Args:
        path: Where it drives.
        start: Metres along the path at time zero.
        speeds: (K,) m/s at ``sample_times(duration_s)``.
        duration_s: Of the drive.
        terrain: Gives height, pitch and roll.
        rng: Draws the sway.
    """
    times = sample_times(duration_s)
    travelled = distance_of(times, speeds)
    places, yaw = path.at(start + travelled)
    corners = corners_of(places, yaw, WHEELS_M).reshape(-1, 2)
    z, pitch, roll = attitude(terrain.height(corners).reshape(-1, 4), WHEELS_M)
    brake = -np.gradient(speeds, times)
    sideways = speeds * np.gradient(yaw, times)
    size, moving = rng.uniform(0.0, 0.005), np.clip(speeds / 5, 0, 1)
    bounce = (
        size * moving * np.sin(2 * np.pi * rng.uniform(0.9, 2.2) * times + rng.uniform(0, 6.28))
    )
    sway = size * moving * np.sin(2 * np.pi * rng.uniform(0.5, 1.5) * times + rng.uniform(0, 6.28))
    angles = np.stack([yaw, pitch + 0.006 * brake + bounce, roll + 0.004 * sideways + sway], axis=1)
    heave = z + 2.0 * size * moving * np.sin(2 * np.pi * 1.3 * times)
    return Trajectory(times, np.column_stack([places, heave]), angles, travelled)
