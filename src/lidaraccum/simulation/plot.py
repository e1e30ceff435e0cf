"""The building site: places things on free ground and remembers what stands where."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Mesh
from lidaraccum.simulation.models import Model
from lidaraccum.simulation.motion import poses_of
from lidaraccum.simulation.roads import Network
from lidaraccum.simulation.terrain import Terrain, attitude, corners_of
from lidaraccum.simulation.thicket import Thickets

Array = NDArray[np.float64]
FOOT_M = 1.8
"""What a thing has below this height must not stand in anyone's way."""


@dataclass(frozen=True, eq=False)
class Still:
    """Something movable that does not move.

    Attributes:
        id: Its instance.
        model: Its shape.
        world_from_object: (4, 4), the object's origin on the ground under its middle.
    """

    id: int
    model: Model
    world_from_object: Array


class Plot:
    """Collects the parts of a world; nothing may stand in another's place.

    Args:
        network: Roads to keep free.
        terrain: Ground to stand on.
        rng: What is drawn while building comes from here.
        thickets: Grow some of the plants.
    """

    def __init__(
        self, network: Network, terrain: Terrain, rng: np.random.Generator, thickets: Thickets
    ) -> None:
        self.network = network
        self.terrain = terrain
        self.rng = rng
        self.thickets = thickets
        self.parts: list[Mesh] = []
        self.stills: list[Still] = []
        self._discs = np.zeros((256, 3))
        self._count = 0

    @property
    def discs(self) -> Array:
        """(D, 3) x, y, radius of what is taken, metres."""
        return self._discs[: self._count]

    def is_free(self, place: Array, radius: float) -> bool:
        """Whether a disc overlaps nothing yet."""
        return bool(self.are_free(place[None], radius)[0])

    def are_free(self, places: Array, radius: float) -> NDArray[np.bool_]:
        """(N,) whether discs about places (N, 2) overlap nothing yet."""
        x, y, wide = self.discs.T
        gap = (x - places[:, :1]) ** 2 + (y - places[:, 1:]) ** 2
        return ~(gap < (wide + radius) ** 2).any(axis=1)

    def take(self, places: Array, radius: float) -> None:
        """Reserve discs about places (N, 2)."""
        places = np.atleast_2d(places)
        while self._count + len(places) > len(self._discs):
            self._discs = np.concatenate([self._discs, np.zeros_like(self._discs)])
        end = self._count + len(places)
        self._discs[self._count : end, :2] = places
        self._discs[self._count : end, 2] = radius
        self._count = end

    def off_road(self, places: Array, margin: float) -> NDArray[np.bool_]:
        """(N,) whether places (N, 2) are ``margin`` metres or more from every carriageway."""
        return self.terrain.covers(places) & (self.terrain.kerb_distance(places) > margin)

    def put(self, mesh: Mesh, place: Array, yaw: float, sink: float = 0.0) -> None:
        """Set a mesh on the ground, ``sink`` metres deep."""
        height = float(self.terrain.standing_height(place[None])[0])
        self.parts.append(mesh.moved((float(place[0]), float(place[1]), height - sink), yaw))

    def scatter(
        self,
        makers: Callable[[np.random.Generator], Mesh],
        places: Array,
        yaws: Array,
        margin: float = 0.3,
    ) -> None:
        """Set one thing at each place (N, 2) that is off the road and free.

        Args:
            makers: Makes a mesh.
            places: (N, 2) metres.
            yaws: (N,) radians.
            margin: Least distance from a carriageway, metres.
        """
        keep = self.off_road(places, margin)
        for place, yaw in zip(places[keep], yaws[keep], strict=True):
            mesh = makers(self.rng)
            spots, radius = _footprint(mesh, place, float(yaw))
            if not self.off_road(spots, min(margin, 0.3) + radius).all():
                continue
            if self.are_free(spots, radius).all():
                self.take(spots, radius)
                self.put(mesh, place, float(yaw), 0.05)

    def run_barrier(
        self,
        maker: Callable[[Array, np.random.Generator], Mesh],
        line: Array,
        radius: float = 0.5,
        margin: float = 0.3,
    ) -> None:
        """Draw a barrier along the free stretch of ground points (K, 2), about a metre apart.

        Args:
            maker: Makes a barrier along ground points (K, 3).
            line: (K, 2) metres.
            radius: Half of what it takes up, metres.
            margin: Least distance from a carriageway, metres; negative in a parking strip.
        """
        keep = self.off_road(line, margin)
        free = keep & self.are_free(line, radius)
        breaks = np.flatnonzero(np.diff(np.r_[False, free, False].astype(int)))
        for start, end in zip(breaks[::2], breaks[1::2], strict=True):
            if end - start < 4:
                continue
            stretch = line[start:end]
            heights = self.terrain.standing_height(stretch)
            ground = np.concatenate([stretch, heights[:, None]], axis=1)
            self.parts.append(self.thickets.line(maker, maker(ground, self.rng), ground))
            self.take(stretch, radius)

    def park(self, model: Model, place: Array, yaw: float, *, anywhere: bool = False) -> bool:
        """Leave something movable standing at a place (2,) if that is free."""
        length, width, _ = model.size_lwh
        along = np.array([np.cos(yaw), np.sin(yaw)])
        spots = place + np.linspace(-0.5, 0.5, 3)[:, None] * max(length - width, 0) * along
        radius = 0.5 * min(width, length) + 0.15
        if not self.terrain.covers(spots, 3.0).all():
            return False
        if not anywhere and not self.are_free(spots, radius).all():
            return False
        self.take(spots, radius)
        size = (0.6 * length, 0.8 * width)
        corners = corners_of(place[None], np.array([yaw]), size).reshape(4, 2)
        heights = self.terrain.standing_height(corners)[None]
        z, pitch, roll = attitude(heights, size)
        centre = np.array([[place[0], place[1], z[0]]])
        pose = poses_of(centre, np.array([[yaw, pitch[0], roll[0]]]))[0]
        self.stills.append(Still(len(self.stills) + 1, model, pose))
        return True


def _footprint(mesh: Mesh, place: Array, yaw: float) -> tuple[Array, float]:
    """Discs that cover what a mesh takes up near the ground: centres (N, 2) and their radius."""
    foot = mesh.vertices[mesh.vertices[:, 2] < FOOT_M, :2]
    if not len(foot):
        return place[None], 0.5
    low, high = foot.min(axis=0).astype(np.float64), foot.max(axis=0).astype(np.float64)
    size = high - low
    longer = int(size[1] > size[0])
    radius = 0.55 * float(size[1 - longer]) + 0.05
    count = min(int(size[longer] / max(size[1 - longer], 0.3)) + 1, 6)
    spots = np.repeat(0.5 * (low + high)[None], count, axis=0)
    spread = 0.5 * max(float(size[longer]) - 2 * radius, 0.0)
    spots[:, longer] += np.linspace(-spread, spread, count) if count > 1 else 0.0
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = np.stack(
        [cos * spots[:, 0] - sin * spots[:, 1], sin * spots[:, 0] + cos * spots[:, 1]], axis=1
    )
    return place + turned, radius
