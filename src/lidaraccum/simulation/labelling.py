"""The truth about a simulated frame: labels row by row, boxes of all that could be seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Box, Labels
from lidaraccum.geometry.rigid import invert
from lidaraccum.simulation.actors import Actor
from lidaraccum.simulation.plot import Still
from lidaraccum.simulation.surfaces import Surface

Array = NDArray[np.float64]
DYNAMIC_MPS = 0.5
"""What moves faster is dynamic."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What each delivered point is of.

    Attributes:
        instance: (N,) int32 of what the ray met.
        surface: (N,) uint8 ``Surface`` of it.
        solid: (N,) bool: an echo of that, not of the air, and not a zero.
        mixed: (N,) bool: between two surfaces.
    """

    instance: NDArray[np.int32]
    surface: NDArray[np.uint8]
    solid: NDArray[np.bool_]
    mixed: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Movables:
    """Everything movable of a drive.

    Attributes:
        stills: What is parked; ids from 1 upwards.
        actors: What has a trajectory; ids follow.
    """

    stills: tuple[Still, ...]
    actors: tuple[Actor, ...]

    @property
    def everyone(self) -> tuple[Still | Actor, ...]:
        """All of them; row ``id - 1``."""
        return (*self.stills, *self.actors)

    def speeds_at(self, stamp: float) -> Array:
        """(K,) m/s of each, parked ones first: row ``id - 1``."""
        driven = [actor.trajectory.speed_at(stamp) for actor in self.actors]
        return np.concatenate([np.zeros(len(self.stills)), driven])

    def centres_at(self, stamp: float) -> Array:
        """(K, 4, 4) world_from_box of each: the box's centre and heading."""
        driven = [actor.trajectory.poses_at(np.array([stamp]))[0] for actor in self.actors]
        poses = [*(still.world_from_object for still in self.stills), *driven]
        stacked = np.stack(poses) if poses else np.zeros((0, 4, 4))
        heights = np.array([one.model.size_lwh[2] for one in self.everyone])
        stacked[:, :3, 3] += 0.5 * heights[:, None] * stacked[:, :3, 2]
        return stacked

    def boxes(self, stamp: float, world_from_sensor: Array, reach_m: float) -> tuple[Box, ...]:
        """Boxes of all that lies within reach, seen or not."""
        sensor_from_box = invert(world_from_sensor) @ self.centres_at(stamp)
        speeds = self.speeds_at(stamp)
        near = np.linalg.norm(sensor_from_box[:, :3, 3], axis=1) < reach_m
        everyone = self.everyone
        return tuple(
            Box(
                everyone[row].id,
                everyone[row].model.category,
                everyone[row].model.size_lwh,
                sensor_from_box[row],
                float(speeds[row]),
                bool(speeds[row] > DYNAMIC_MPS),
            )
            for row in np.flatnonzero(near)
        )


def label(
    seen: Seen, movables: Movables, stamp: float, world_from_sensor: Array, reach_m: float
) -> Labels:
    """The truth about a frame.

    Args:
        seen: What its points are of.
        movables: All of the drive.
        stamp: The frame's reference time, seconds.
        world_from_sensor: (4, 4) pose of the frame's coordinates at the stamp.
        reach_m: Boxes are listed up to this distance.
    """
    instance = np.where(seen.solid, seen.instance, 0).astype(np.int32)
    surface = np.where(seen.solid, seen.surface, np.uint8(Surface.CLUTTER))
    moving = np.concatenate([[False], movables.speeds_at(stamp) > DYNAMIC_MPS])
    return Labels(
        world_from_sensor=world_from_sensor,
        foreground=instance > 0,
        dynamic=moving[instance],
        instance=instance,
        boxes=movables.boxes(stamp, world_from_sensor, reach_m),
        annotated=seen.solid & (surface != Surface.OWN_CAR) & ~seen.mixed,
        semantic=surface.astype(np.int16),
    )
