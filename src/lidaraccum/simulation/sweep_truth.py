"""Where the points of a rolling shutter were at the frame's stamp."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.rigid import invert
from lidaraccum.simulation.actors import Actor

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sweep:
    """A turn of the sensor and the poses it was made from.

    Attributes:
        stamp: Reference time, seconds.
        times: (C,) seconds of each column.
        frame_from_sensor: (C, 4, 4) or (1, 4, 4): from the sensor as each column was fired to the
            frame's coordinates at the stamp.
        world_from_frame: (4, 4) at the stamp.
    """

    stamp: float
    times: Array
    frame_from_sensor: Array
    world_from_frame: Array

    def at_stamp(self, local: NDArray[np.float32]) -> NDArray[np.float32]:
        """Points (C, B, 3) in the sensor's coordinates, as if the sensor had stood still."""
        rotation = np.swapaxes(self.frame_from_sensor[:, :3, :3], 1, 2).astype(np.float32)
        shift = self.frame_from_sensor[:, None, :3, 3].astype(np.float32)
        return (local @ rotation + shift).astype(np.float32)

    def carry(
        self, points: NDArray[np.float32], owners: NDArray[np.int32], column: NDArray[np.int64],
        actors: Iterable[Actor],
    ) -> NDArray[np.float32]:  # fmt: skip
        """Take actors' points along by their own motion from when they were measured to the stamp.

        Args:
            points: (N, 3) metres, the frame's coordinates at the stamp, ego-motion undone.
            owners: (N,) instance of each point.
            column: (N,) column each point was measured in.
            actors: What moves.
        """
        carried, seen = points.copy(), set(np.unique(owners).tolist())
        frame_from_world = invert(self.world_from_frame)
        for actor in actors:
            if actor.id not in seen:
                continue
            own = np.flatnonzero(owners == actor.id)
            columns, place = np.unique(column[own], return_inverse=True)
            then = actor.trajectory.poses_at(np.append(self.times[columns], self.stamp))
            motion = frame_from_world @ then[-1] @ invert(then[:-1]) @ self.world_from_frame
            motion = motion[place]
            carried[own] = (
                np.einsum("nij,nj->ni", motion[:, :3, :3], points[own]) + motion[:, :3, 3]
            )
        return carried
