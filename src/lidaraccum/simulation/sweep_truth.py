"""Where the points of a rolling shutter were at the frame's stamp."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.rigid import invert
from lidaraccum.simulation.actors import Actor

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moments:
    """When each point was measured, and where the frame's coordinates were then.

    Attributes:
        times: (C,) seconds of each column.
        poses: (C, 4, 4) world from the frame's coordinates at those times.
        column: (N,) which column each point was measured in.
    """

    times: Array
    poses: Array
    column: NDArray[np.int64]

    def to_world(self, points: NDArray[Any]) -> Array:
        """(N, 3) metres, world, of points (N, 3) as measured."""
        return _each(self.poses[self.column], points.astype(np.float64))


def follow_actors(
    world: Array, instance: NDArray[np.int32], then: Moments, stamp: float, actors: Iterable[Actor]
) -> None:
    """Take actors' points from where they were measured to where they were at the stamp.

    Args:
        world: (N, 3) metres, changed in place.
        instance: (N,) whose each point is.
        then: When each was measured.
        stamp: Seconds.
        actors: What moves.
    """
    seen = set(np.unique(instance).tolist())
    for actor in actors:
        if actor.id not in seen:
            continue
        own = np.flatnonzero(instance == actor.id)
        columns, place = np.unique(then.column[own], return_inverse=True)
        world_from_actor = actor.trajectory.poses_at(np.append(then.times[columns], stamp))
        motions = world_from_actor[-1] @ invert(world_from_actor[:-1])
        world[own] = _each(motions[place], world[own])


def _each(poses: Array, points: Array) -> Array:
    return np.einsum("nij,nj->ni", poses[:, :3, :3], points) + poses[:, :3, 3]
