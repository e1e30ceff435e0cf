"""The ground: a height field with slopes, crown, banks and ditches, and the kerbs laid on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Finish, Mesh, grid, merge, of_triangles
from lidaraccum.simulation.roads import Network, Road
from lidaraccum.simulation.surfaces import Surface

Array = NDArray[np.float64]
CELL_M = 2.0
MARGIN_M = 110.0
"""Ground laid about the ego's way."""


@dataclass(frozen=True, eq=False)
class Terrain:
    """Heights and distances on a grid of ``CELL_M``, linear on triangles between.

    Attributes:
        corner: (2,) x, y of the first grid point, metres.
        fields: (X, Y, 3) metres: height; distance from the nearest kerb, negative on a carriageway;
            distance from the outer edge of the nearest pavement, negative inside.
        kerb_m: How much higher pavements lie than the road.
    """

    corner: Array
    fields: Array
    kerb_m: float

    @property
    def heights(self) -> Array:
        """(X, Y) metres."""
        return self.fields[..., 0]

    def height(self, places: Array) -> Array:
        """Metres (N,) at places (N, 2), exactly on the ground's triangles."""
        return self._between(places)[:, 0]

    def kerb_distance(self, places: Array) -> Array:
        """Metres (N,) from the nearest kerb of places (N, 2); negative on a carriageway."""
        return self._between(places)[:, 1]

    def walk_distance(self, places: Array) -> Array:
        """Metres (N,) from the outer edge of the nearest pavement; negative inside."""
        return self._between(places)[:, 2]

    def standing_height(self, places: Array) -> Array:
        """Metres (N,) on which one stands: the ground, or the pavement that lies on it."""
        height, kerb, walk = self._between(places).T
        return height + np.where((kerb >= 0) & (walk < 0), self.kerb_m, 0.0)

    def _between(self, places: Array) -> Array:
        """(N, 3) the fields at places (N, 2)."""
        scaled = (np.asarray(places) - self.corner) / CELL_M
        rows, columns = self.fields.shape[:2]
        u = np.minimum(np.maximum(scaled[:, 0], 0.0), rows - 1.001)
        v = np.minimum(np.maximum(scaled[:, 1], 0.0), columns - 1.001)
        i, j = u.astype(np.int64), v.astype(np.int64)
        u, v = (u - i)[:, None], (v - j)[:, None]
        steep = (u > v)[:, 0]
        low, high = self.fields[i, j], self.fields[i + 1, j + 1]
        side = self.fields[i + steep, j + ~steep]
        return low + np.maximum(u, v) * (side - low) + np.minimum(u, v) * (high - side)

    def covers(self, places: Array, margin: float = 1.0) -> NDArray[np.bool_]:
        """Whether places (N, 2) lie on the ground, ``margin`` metres from its edge."""
        low = self.corner + margin
        high = self.corner + CELL_M * (np.array(self.fields.shape[:2]) - 1) - margin
        return np.all((places > low) & (places < high), axis=1)


def shape_terrain(network: Network, way: Array, rng: np.random.Generator) -> Terrain:
    """Ground about the ego's way (K, 2), metres."""
    low, high = way.min(axis=0) - MARGIN_M, way.max(axis=0) + MARGIN_M
    shape = ((high - low) / CELL_M).astype(int) + 2
    x = low[0] + CELL_M * np.arange(shape[0])
    y = low[1] + CELL_M * np.arange(shape[1])
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=2).reshape(-1, 2)
    kerb, walk = network.edge_distances(places)
    heights = (
        _rolling(places, rng) + _crown(network, kerb, rng) + _banks(network, places, walk, rng)
    )
    for island in network.islands:
        gap = np.linalg.norm(places - island[:2], axis=1)
        heights += rng.uniform(0, 1.5) * np.clip(1 - gap / island[2], 0, 1)
    fields = np.stack([heights, kerb, walk], axis=1).reshape(*shape, 3)
    return Terrain(low, fields, float(rng.choice([0.05, 0.1, 0.13, 0.16])))


def _rolling(places: Array, rng: np.random.Generator) -> Array:
    """Slope of the land and long waves on it; zero at the origin."""
    steep = 0.02 if rng.random() < 0.6 else 0.07
    slope = steep * rng.standard_normal(2)
    heights = places @ np.clip(slope, -0.1, 0.1)
    for _ in range(3):
        wave = 2 * np.pi / rng.uniform(60, 220)
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        tilt = rng.uniform(0, 0.02) / wave
        across = places @ np.array([np.cos(angle), np.sin(angle)])
        heights += tilt * (np.sin(wave * across + phase) - np.sin(phase))
    return heights


def _crown(network: Network, kerb: Array, rng: np.random.Generator) -> Array:
    """The middle of a road stands higher than its sides."""
    height, half = rng.uniform(0.0, 0.12), max(network.roads[0].half_m, 1.0)
    return height * np.clip(1 - (1 + kerb / half) ** 2, 0, 1)


def _banks(network: Network, places: Array, out: Array, rng: np.random.Generator) -> Array:
    """Banks, cuttings and ditches beside the road, and rough ground beyond it."""
    open_land = network.kind in ("rural", "highway", "bridge", "tunnel", "suburban")
    chance = 0.7 if open_land else 0.2
    heights = np.where(out > 1.0, 0.04 * rng.standard_normal(len(places)), 0.0)
    if rng.random() < chance:
        side = network.roads[0].centre
        left = np.sign(_lateral(side.points, places))
        start, width = rng.uniform(1.5, 8), rng.uniform(2, 8)
        rise = rng.uniform(-1.5, 3.5, 2)
        ramp = np.clip((out - start) / width, 0, 1)
        heights += np.where(left > 0, rise[0], rise[1]) * ramp**2 * (3 - 2 * ramp)
    if network.kind in ("rural", "highway") and rng.random() < 0.6:
        heights -= rng.uniform(0.2, 0.7) * np.exp(-(((out - 2.5) / 1.2) ** 2))
    return heights


def _lateral(line: Array, places: Array) -> Array:
    """Signed side (N,) of a line about which places (N, 2) lie; positive to the left."""
    ahead = line[-1] - line[0]
    offset = places - line[len(line) // 2]
    return ahead[0] * offset[:, 1] - ahead[1] * offset[:, 0]


def attitude(heights: Array, size: tuple[float, float]) -> tuple[Array, Array, Array]:
    """Height of the middle, pitch (positive: nose down) and roll of what stands on four corners.

    Args:
        heights: (M, 4) of the ground under its corners, ordered as by ``corners_of``.
        size: Length and width between the corners, metres.
    """
    front, rear = heights[:, :2].mean(axis=1), heights[:, 2:].mean(axis=1)
    left, right = heights[:, ::2].mean(axis=1), heights[:, 1::2].mean(axis=1)
    pitch = -np.arctan2(front - rear, size[0])
    return heights.mean(axis=1), pitch, np.arctan2(left - right, size[1])


def corners_of(places: Array, yaw: Array, size: tuple[float, float]) -> Array:
    """(M, 4, 2) corners of rectangles: front left, front right, rear left, rear right."""
    ahead = 0.5 * size[0] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    left = 0.5 * size[1] * np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
    return np.stack(
        [
            places + ahead + left,
            places + ahead - left,
            places - ahead + left,
            places - ahead - left,
        ],
        axis=1,
    )


def ground_mesh(terrain: Terrain, network: Network, rng: np.random.Generator) -> Mesh:
    """The height field as triangles, each with the surface that lies there."""
    rows, columns = terrain.heights.shape
    x = terrain.corner[0] + CELL_M * np.arange(rows)
    y = terrain.corner[1] + CELL_M * np.arange(columns)
    vertices = np.stack([*np.meshgrid(x, y, indexing="ij"), terrain.heights], axis=2)
    start = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    triangles = np.concatenate(
        [
            np.stack([start, start + columns, start + columns + 1], axis=1),
            np.stack([start, start + columns + 1, start + 1], axis=1),
        ]
    )
    flat = vertices.reshape(-1, 3)
    mesh = of_triangles(flat, triangles, Finish(Surface.ROAD, 0.2))
    centres = np.concatenate([flat[start, :2] + [1.2, 0.6], flat[start, :2] + [0.6, 1.2]])
    surface = _surface_at(terrain, network, centres, rng)
    shade = np.array([0.2] * 32)
    shade[[Surface.ROAD, Surface.SIDEWALK, Surface.GRASS, Surface.GRAVEL]] = (
        rng.uniform(0.1, 0.3), rng.uniform(0.2, 0.4), rng.uniform(0.3, 0.6), rng.uniform(0.2, 0.45),
    )  # fmt: skip
    reflectivity = shade[surface] * rng.uniform(0.9, 1.1, len(surface))
    return Mesh(
        mesh.vertices, mesh.triangles, surface.astype(np.uint8), reflectivity.astype(np.float32)
    )


def _surface_at(
    terrain: Terrain, network: Network, places: Array, rng: np.random.Generator
) -> NDArray[np.int64]:
    town = network.kind in ("straight", "curved", "crossing", "square", "industrial")
    paved = rng.random() < (0.6 if town else 0.1)
    beyond = Surface.SIDEWALK if paved else Surface.GRASS
    if network.kind == "industrial":
        beyond = Surface.GRAVEL
    kerb, walk = terrain.kerb_distance(places), terrain.walk_distance(places)
    surface = np.where(kerb < 0, Surface.ROAD, np.where(walk < 0, Surface.SIDEWALK, beyond))
    surface[network.in_square(places) & (kerb >= 0)] = Surface.SIDEWALK
    return surface


def kerb_mesh(terrain: Terrain, network: Network, rng: np.random.Generator) -> Mesh:
    """Raised pavements: a kerb's face and the slab behind it, left out where roads meet."""
    height = terrain.kerb_m
    finish = Finish(Surface.SIDEWALK, float(rng.uniform(0.2, 0.45)))
    parts = [
        _kerb(terrain, network, road, side, height, finish)
        for road in network.roads
        if road.walk_m > 0
        for side in (-1, 1)
    ]
    parts += [_island(terrain, island, height, finish) for island in network.islands]
    return merge(parts)


def _kerb(
    terrain: Terrain, network: Network, road: Road, side: int, height: float, finish: Finish
) -> Mesh:
    along = np.arange(0.0, road.centre.length, 2.0)
    lateral = road.half_m + np.array([0.0, 0.02, road.walk_m, road.walk_m + 0.03])
    places = np.stack([road.centre.at(along, side * one)[0] for one in lateral], axis=1)
    heights = terrain.height(places.reshape(-1, 2)).reshape(places.shape[:2])
    raised = heights + np.array([-0.05, height, height, -0.05])
    strip = grid(np.concatenate([places, raised[..., None]], axis=2), finish)
    middle = places[:, 1:3].mean(axis=1)
    keep = terrain.covers(middle) & (terrain.kerb_distance(middle) > -0.1)
    keep = np.repeat(keep[:-1] & keep[1:], 3)
    keep = np.concatenate([keep, keep])
    return Mesh(
        strip.vertices, strip.triangles[keep], strip.surface[keep], strip.reflectivity[keep]
    )


def _island(terrain: Terrain, island: Array, height: float, finish: Finish) -> Mesh:
    angle = np.linspace(0, 2 * np.pi, 33)
    radii = island[2] - np.array([0.0, 0.02, 1.0])
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)[:, None] * radii[:, None]
    places = ring + island[:2]
    heights = terrain.height(places.reshape(-1, 2)).reshape(places.shape[:2])
    raised = heights + np.array([-0.05, height, height * 0.3])
    return grid(np.concatenate([places, raised[..., None]], axis=2), finish)
