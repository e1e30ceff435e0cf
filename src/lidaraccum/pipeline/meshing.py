"""From an accumulated cloud to a surface: screened Poisson, tile by tile where it is large."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray
from lidaraccum.errors import InputError, SettingsError

log = logging.getLogger(__name__)

MIN_POINTS = 100
"""Fewer points than this make no surface worth writing."""

TILE_OVERLAP_M = 2.0
"""Points this far beyond a tile's edge take part in it, so that neighbours meet."""


@dataclass(frozen=True)
class MeshSettings:
    """How the surface is made; the defaults are the paper's (supplement, mesh reconstruction).

    Attributes:
        depth: Octree depth of the Poisson solver.
        normal_radius_m: Neighbourhood for normals, metres.
        normal_neighbours: At most so many neighbours.
        trim_percentile: Vertices below this percentile of density are removed.
        voxel_m: Points are thinned to one in each cube of this edge first; 0 keeps all.
        tile_m: Edge of a tile, metres; 0 takes everything in one piece.
    """

    depth: int = 10
    normal_radius_m: float = 0.5
    normal_neighbours: int = 128
    trim_percentile: float = 15.0
    voxel_m: float = 0.0
    tile_m: float = 0.0

    def __post_init__(self) -> None:
        lengths = (self.normal_radius_m, self.trim_percentile, self.voxel_m, self.tile_m)
        if not np.isfinite(lengths).all():
            raise SettingsError("radius, percentile, voxel and tile must be finite numbers")
        if not 1 <= self.depth <= 16:
            raise SettingsError(f"depth {self.depth} is not within 1 to 16")
        if not 0 <= self.trim_percentile < 100:
            raise SettingsError(f"percentile {self.trim_percentile} is not within 0 to 100")
        if self.tile_m and self.tile_m <= 2 * TILE_OVERLAP_M:
            raise SettingsError(f"a tile must be larger than {2 * TILE_OVERLAP_M} m")
        if self.normal_radius_m <= 0 or self.normal_neighbours < 3 or self.voxel_m < 0:
            raise SettingsError("normals need a positive radius and at least 3 neighbours")


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: (V, 3) float64, metres, in the cloud's coordinates.
        triangles: (F, 3) int32 rows of ``vertices``, counter-clockwise seen from outside.
        normals: (V, 3) float64, unit length, towards the side the sensor saw.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]
    normals: NDArray[np.float64]


def reconstruct(
    points: NDArray[np.float64],
    viewpoints: NDArray[np.float64],
    settings: MeshSettings | None = None,
) -> Mesh:
    """The surface through a cloud (METHOD section 8).

    Args:
        points: (N, 3) metres.
        viewpoints: (N, 3) metres: where the sensor was that saw each point; normals face it.
        settings: The paper's by default.

    Raises:
        InputError: Too few points for a surface.
    """
    settings = settings or MeshSettings()
    if len(points) < MIN_POINTS:
        raise InputError(f"{len(points)} points are too few for a mesh, it takes {MIN_POINTS}")
    centre = np.round(np.median(points, axis=0))
    points, viewpoints = points - centre, viewpoints - centre
    pieces = [
        _within(_poisson(points[near], viewpoints[near], settings), low, high)
        for near, low, high in _tiles(points, settings.tile_m)
    ]
    mesh = _joined(pieces)
    if not len(mesh.triangles):
        raise InputError("no surface came out: the points are too thin", hint="a smaller --depth")
    return Mesh(mesh.vertices + centre, mesh.triangles, mesh.normals)


Corner = NDArray[np.float64]


def _tiles(
    points: NDArray[np.float64], edge_m: float
) -> Iterator[tuple[BoolArray, Corner, Corner]]:
    """For each tile with enough points: its points and its lower and upper corner in x, y."""
    flat = points[:, :2]
    if not edge_m:
        infinite = np.full(2, np.inf)
        yield np.ones(len(points), dtype=bool), -infinite, infinite
        return
    for corner in np.unique(np.floor(flat / edge_m), axis=0):
        low, high = corner * edge_m, (corner + 1) * edge_m
        beyond = TILE_OVERLAP_M
        near = np.all((flat >= low - beyond) & (flat < high + beyond), axis=1)
        if np.count_nonzero(near) >= MIN_POINTS:
            log.info("tile at %.0f, %.0f m: %d points", *low, np.count_nonzero(near))
            yield near, low, high


def _poisson(
    points: NDArray[np.float64], viewpoints: NDArray[np.float64], settings: MeshSettings
) -> Mesh:
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    # The viewpoint rides along as a normal, so that thinning averages both alike.
    cloud.normals = o3d.utility.Vector3dVector(viewpoints)
    if settings.voxel_m:
        cloud = cloud.voxel_down_sample(settings.voxel_m)
    towards = np.asarray(cloud.normals) - np.asarray(cloud.points)
    search = o3d.geometry.KDTreeSearchParamHybrid(
        settings.normal_radius_m, settings.normal_neighbours
    )
    cloud.normals = o3d.utility.Vector3dVector()
    cloud.estimate_normals(search)
    normals = np.asarray(cloud.normals)
    facing = np.einsum("ij,ij->i", normals, towards) >= 0
    cloud.normals = o3d.utility.Vector3dVector(np.where(facing[:, None], normals, -normals))
    surface, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        cloud, depth=settings.depth
    )
    densities = np.asarray(density)
    if len(densities):
        thin = densities < np.percentile(densities, settings.trim_percentile)
        surface.remove_vertices_by_mask(thin)
    surface.compute_vertex_normals()
    return _as_mesh(surface)


def _as_mesh(surface: Any) -> Mesh:
    return Mesh(
        vertices=np.asarray(surface.vertices).copy(),
        triangles=np.asarray(surface.triangles).astype(np.int32),
        normals=np.asarray(surface.vertex_normals).copy(),
    )


def _within(mesh: Mesh, low: Corner, high: Corner) -> Mesh:
    """The triangles whose middle lies in the tile, and the vertices that they use."""
    middles = mesh.vertices[mesh.triangles].mean(axis=1)[:, :2]
    kept = mesh.triangles[np.all((middles >= low) & (middles < high), axis=1)]
    used, renumbered = np.unique(kept, return_inverse=True)
    return Mesh(
        vertices=mesh.vertices[used],
        triangles=renumbered.reshape(-1, 3).astype(np.int32),
        normals=mesh.normals[used],
    )


def _joined(pieces: list[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    return Mesh(
        vertices=np.concatenate([piece.vertices for piece in pieces]),
        triangles=np.concatenate(
            [piece.triangles + start for piece, start in zip(pieces, starts[:-1], strict=True)]
        ).astype(np.int32),
        normals=np.concatenate([piece.normals for piece in pieces]),
    )


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Write a mesh as PLY, OBJ, STL, OFF or glTF, whichever the suffix says."""
    import open3d as o3d

    surface = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(mesh.vertices), o3d.utility.Vector3iVector(mesh.triangles)
    )
    surface.vertex_normals = o3d.utility.Vector3dVector(mesh.normals)
    surface.compute_triangle_normals()
    if not o3d.io.write_triangle_mesh(path, surface):
        raise OSError(f"Open3D could not write {path}")
