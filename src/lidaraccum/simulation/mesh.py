"""Triangle meshes with a surface and a reflectivity a triangle, and the solids they start from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.surfaces import Surface

Array = NDArray[np.floating[Any]]
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Finish:
    """What a part is made of.

    Attributes:
        surface: Kind of surface.
        reflectivity: 0..1 diffuse reflectivity in the laser's colour.
    """

    surface: Surface
    reflectivity: float


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one or many parts.

    Attributes:
        vertices: (V, 3) float32, metres, the object's or the world's coordinates.
        triangles: (F, 3) int32 rows of ``vertices``.
        surface: (F,) uint8 ``Surface`` of each triangle.
        reflectivity: (F,) float32, 0..1.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    surface: NDArray[np.uint8]
    reflectivity: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.triangles)

    def moved(self, shift: Triple, yaw: float = 0.0, scale: float | Triple = 1.0) -> Mesh:
        """Scaled, then turned about z by ``yaw`` radians, then shifted by metres."""
        scaled = self.vertices * np.asarray(scale, dtype=np.float32)
        cos, sin = np.float32(np.cos(yaw)), np.float32(np.sin(yaw))
        x, y = scaled[:, 0], scaled[:, 1]
        turned = np.stack([cos * x - sin * y, sin * x + cos * y, scaled[:, 2]], axis=1)
        return self.with_vertices(turned + np.asarray(shift, dtype=np.float32))

    def posed(self, to_from: NDArray[np.float64]) -> Mesh:
        """Moved by a rigid motion (4, 4)."""
        motion = to_from.astype(np.float32)
        return self.with_vertices(self.vertices @ motion[:3, :3].T + motion[:3, 3])

    def pitched(self, angle: float, pivot: Triple) -> Mesh:
        """Turned about the y axis through ``pivot`` by ``angle`` radians (positive: nose down)."""
        cos, sin = np.cos(angle), np.sin(angle)
        rotation = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]], dtype=np.float32)
        centre = np.asarray(pivot, dtype=np.float32)
        return self.with_vertices((self.vertices - centre) @ rotation.T + centre)

    def with_vertices(self, vertices: Array) -> Mesh:
        """The same triangles on other vertices (V, 3)."""
        return Mesh(
            np.ascontiguousarray(vertices, dtype=np.float32),
            self.triangles,
            self.surface,
            self.reflectivity,
        )

    @property
    def corners(self) -> NDArray[np.float32]:
        """(F, 3, 3) float32 corners of each triangle."""
        return self.vertices[self.triangles]

    @property
    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest corner (3,), metres."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)


def merge(parts: Iterable[Mesh]) -> Mesh:
    """One mesh of many."""
    pieces = [part for part in parts if len(part)]
    if not pieces:
        return empty()
    counts = np.array([len(piece.vertices) for piece in pieces])
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int32)
    return Mesh(
        np.concatenate([piece.vertices for piece in pieces]),
        np.concatenate(
            [piece.triangles + start for piece, start in zip(pieces, starts, strict=True)]
        ),
        np.concatenate([piece.surface for piece in pieces]),
        np.concatenate([piece.reflectivity for piece in pieces]),
    )


def empty() -> Mesh:
    """No triangles at all."""
    return Mesh(
        np.zeros((0, 3), np.float32),
        np.zeros((0, 3), np.int32),
        np.zeros(0, np.uint8),
        np.zeros(0, np.float32),
    )


def of_triangles(vertices: Array, triangles: NDArray[np.integer], finish: Finish) -> Mesh:
    """A mesh of one finish from vertices (V, 3), metres, and rows (F, 3)."""
    count = len(triangles)
    return Mesh(
        np.ascontiguousarray(vertices, dtype=np.float32),
        np.ascontiguousarray(triangles, dtype=np.int32),
        np.full(count, finish.surface, dtype=np.uint8),
        np.full(count, finish.reflectivity, dtype=np.float32),
    )


def quads(corners: Array, finish: Finish) -> Mesh:
    """Quadrilaterals (Q, 4, 3), metres, corners in order around each."""
    corners = np.asarray(corners, dtype=np.float32).reshape(-1, 4, 3)
    first = 4 * np.arange(len(corners), dtype=np.int32)[:, None]
    triangles = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return of_triangles(corners.reshape(-1, 3), triangles, finish)


_BOX_CORNERS = np.array(
    [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]
)
_BOX_TRIANGLES = np.array(
    [
        [0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4],
        [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7],
    ]
)  # fmt: skip


def box(size: Triple, base: Triple, finish: Finish, top: tuple[float, float] = (1, 1)) -> Mesh:
    """A box of length, width, height, its base centred at ``base``, its top scaled in x and y."""
    vertices = _BOX_CORNERS * np.array([size[0] / 2, size[1] / 2, size[2]])
    vertices[4:, :2] *= np.asarray(top)
    return of_triangles(vertices + np.asarray(base), _BOX_TRIANGLES, finish)


def grid(vertices: Array, finish: Finish, *, closed: bool = False) -> Mesh:
    """A surface through rows of points (R, K, 3); ``closed`` joins the last point to the first."""
    rows, columns = vertices.shape[:2]
    across = np.arange(columns if closed else columns - 1)
    start = (np.arange(rows - 1)[:, None] * columns + across).ravel()
    right = (np.arange(rows - 1)[:, None] * columns + (across + 1) % columns).ravel()
    triangles = np.concatenate(
        [
            np.stack([start, right, right + columns], axis=1),
            np.stack([start, right + columns, start + columns], axis=1),
        ]
    )
    return of_triangles(vertices.reshape(-1, 3), triangles, finish)


def fan(outline: Array, finish: Finish) -> Mesh:
    """A cap over a star-shaped outline (K, 3) about its mean."""
    count = len(outline)
    vertices = np.concatenate([outline, outline.mean(axis=0, keepdims=True)])
    along = np.arange(count)
    triangles = np.stack([along, (along + 1) % count, np.full(count, count)], axis=1)
    return of_triangles(vertices, triangles, finish)


def lathe(profile: Sequence[tuple[float, float]], finish: Finish, segments: int = 10) -> Mesh:
    """A body of revolution about z from (radius, z) pairs in metres; zero radii close it."""
    radii, heights = np.asarray(profile, dtype=np.float64).T
    angle = 2 * np.pi * np.arange(segments) / segments
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.zeros((len(radii), segments, 3))
    vertices[..., :2] = radii[:, None, None] * ring
    vertices[..., 2] = heights[:, None]
    return grid(vertices, finish, closed=True)


_HEXAGON = np.stack([np.cos(np.pi / 3 * np.arange(6)), np.sin(np.pi / 3 * np.arange(6))], axis=1)
_ROD_TRIANGLES = np.array(
    [[k, (k + 1) % 6, (k + 1) % 6 + 6] for k in range(6)]
    + [[k, (k + 1) % 6 + 6, k + 6] for k in range(6)]
)


def rod(start: Array | Triple, end: Array | Triple, radius: float, finish: Finish) -> Mesh:
    """A six-sided rod between two points, metres, without caps."""
    (ax, ay, az), (bx, by, bz) = start, end
    x, y, z = float(bx - ax), float(by - ay), float(bz - az)
    length = max((x * x + y * y + z * z) ** 0.5, 1e-9)
    flat = (x * x + y * y) ** 0.5
    side = np.array([y / flat, -x / flat, 0.0]) if flat > 1e-3 * length else np.array([1.0, 0, 0])
    up = np.array([side[1] * z, -side[0] * z, side[0] * y - side[1] * x]) / length
    ring = radius * (_HEXAGON[:, :1] * side + _HEXAGON[:, 1:] * up)
    vertices = np.concatenate([ring + np.array([ax, ay, az]), ring + np.array([bx, by, bz])])
    return of_triangles(vertices, _ROD_TRIANGLES, finish)


def disc_wheel(centre: Triple, radius: float, width: float, finish: Finish) -> Mesh:
    """A wheel standing in the x-z plane, its axle along y, both faces closed."""
    profile = [(0.0, -width / 2), (radius, -width / 2), (radius, width / 2), (0.0, width / 2)]
    upright = lathe(profile, finish, segments=12)
    x, y, z = upright.vertices.T
    return upright.with_vertices(np.stack([x, z, y], axis=1) + np.asarray(centre, np.float32))


def blob(
    radii: Triple, centre: Triple, finish: Finish, rng: np.random.Generator, bumps: float = 0.15
) -> Mesh:
    """A bumpy ellipsoid, metres; ``bumps`` is the share by which its radius wanders."""
    rows, columns = 7, 10
    polar = np.pi * np.arange(rows) / (rows - 1)
    around = 2 * np.pi * np.arange(columns) / columns
    sphere = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(around),
            np.sin(polar)[:, None] * np.sin(around),
            np.repeat(np.cos(polar)[:, None], columns, axis=1),
        ],
        axis=2,
    )
    radius = 1 + bumps * rng.standard_normal((rows, columns, 1))
    radius[0], radius[-1] = radius[0, 0], radius[-1, 0]
    return grid(sphere * radius * np.asarray(radii) + np.asarray(centre), finish, closed=True)


def flakes(centres: Array, sizes: Array, finish: Finish, rng: np.random.Generator) -> Mesh:
    """Loose triangles (leaves) about centres (N, 3) of sizes (N,), metres, turned at random."""
    count = len(centres)
    corners = rng.uniform(-1.0, 1.0, (count, 3, 3)) * np.asarray(sizes)[:, None, None]
    vertices = (corners + np.asarray(centres)[:, None]).reshape(-1, 3)
    return of_triangles(vertices, np.arange(3 * count).reshape(-1, 3), finish)


def extrude(outline: Array, width: float, finish: Finish) -> Mesh:
    """A plate: outline (K, 2) in x and z, metres, spread along y to ``width``, capped."""
    sides = np.zeros((2, len(outline), 3))
    sides[:, :, 0], sides[:, :, 2] = outline[:, 0], outline[:, 1]
    sides[0, :, 1], sides[1, :, 1] = -width / 2, width / 2
    return merge([grid(sides, finish, closed=True), fan(sides[0], finish), fan(sides[1], finish)])
