"""Something that moves: a model on a trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Mesh
from lidaraccum.simulation.models import Model
from lidaraccum.simulation.motion import Trajectory
from lidaraccum.simulation.roads import Path
from lidaraccum.simulation.terrain import Terrain, attitude, corners_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Actor:
    """A movable that has a trajectory of its own.

    Attributes:
        id: Its instance.
        model: Its shape.
        trajectory: world_from_object, the origin on the ground under its middle.
    """

    id: int
    model: Model
    trajectory: Trajectory

    def mesh_at(self, time: float) -> Mesh:
        """The mesh of its step at a time; a still one stands in its first phase."""
        steps = self.trajectory.travelled_at(time) / self.model.stride_m
        return self.model.phases[
            int(np.floor(steps * len(self.model.phases))) % len(self.model.phases)
        ]


@dataclass(frozen=True, eq=False)
class Way:
    """How something goes: along a path, at laterals, so far at each time.

    Attributes:
        path: Where.
        along: (K,) metres along the path at the trajectory's times.
        lateral: (K,) metres to the left of the path.
        backwards: Whether it faces against its way (reversing).
    """

    path: Path
    along: Array
    lateral: Array
    backwards: bool = False


def follow(way: Way, model: Model, times: Array, terrain: Terrain) -> Trajectory:
    """The trajectory (K samples) of a model on its way over the ground."""
    places, yaw = way.path.at(way.along, way.lateral)
    drift = np.gradient(way.lateral, times)
    speed = np.gradient(way.along, times)
    yaw = yaw + np.arctan2(drift, np.maximum(np.abs(speed), 1.0)) * np.sign(speed + 1e-9)
    if way.backwards:
        yaw = yaw + np.pi
    length, width, _ = model.size_lwh
    upright = len(model.phases) > 1 or length < 1.2
    size = (0.6 * length, 0.8 * width)
    if upright:
        z = terrain.standing_height(places)
        pitch = roll = np.zeros(len(times))
    else:
        corners = corners_of(places, yaw, size).reshape(-1, 2)
        z, pitch, roll = attitude(terrain.height(corners).reshape(-1, 4), size)
    angles = np.stack([np.unwrap(yaw), pitch, roll], axis=1)
    return Trajectory(times, np.column_stack([places, z]), angles, np.abs(way.along - way.along[0]))
