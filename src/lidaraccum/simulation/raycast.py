"""The one door to a ray caster: meshes in, nearest hits out. Another caster can stand behind it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import MissingDependencyError
from lidaraccum.simulation.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays end.

    Attributes:
        distance: (N,) float32 metres along the ray (of unit direction); inf where nothing is hit.
        triangle: (N,) int32 row of the mesh's triangles; -1 where nothing is hit.
    """

    distance: NDArray[np.float32]
    triangle: NDArray[np.int32]


class RayScene(Protocol):
    """One mesh made ready for rays."""

    def cast(self, rays: NDArray[np.float32], /) -> Hits:
        """Nearest hits of rays (N, 6): origin and unit direction in the mesh's coordinates."""


class RayCaster(Protocol):
    """Makes meshes ready for rays."""

    def scene(self, mesh: Mesh, /) -> RayScene:
        """The mesh, ready; its triangles keep their numbers."""


class Open3DRayCaster:
    """Open3D's RaycastingScene (Embree), on as many threads as told; answers do not depend on it.

    Args:
        threads: CPU threads for building and casting.

    Raises:
        MissingDependencyError: When open3d is not installed.
    """

    def __init__(self, threads: int = 1) -> None:
        try:
            import open3d
        except ImportError as error:
            raise MissingDependencyError(
                "simulation casts its rays with open3d, which is not installed",
                hint="pip install open3d",
            ) from error
        self._open3d = open3d
        self._threads = threads

    def scene(self, mesh: Mesh) -> RayScene:
        """The mesh in an Embree scene."""
        return _Open3DScene(self._open3d, mesh, self._threads)


class _Open3DScene:
    def __init__(self, open3d: object, mesh: Mesh, threads: int) -> None:
        self._tensor = open3d.core.Tensor.from_numpy  # type: ignore[attr-defined]
        self._threads = threads
        self._scene = open3d.t.geometry.RaycastingScene(nthreads=threads)  # type: ignore[attr-defined]
        self._scene.add_triangles(
            self._tensor(np.ascontiguousarray(mesh.vertices)),
            self._tensor(np.ascontiguousarray(mesh.triangles.astype(np.uint32))),
        )

    def cast(self, rays: NDArray[np.float32]) -> Hits:
        answer = self._scene.cast_rays(
            self._tensor(np.ascontiguousarray(rays)), nthreads=self._threads
        )
        distance = answer["t_hit"].numpy()
        triangle = answer["primitive_ids"].numpy().astype(np.int32)
        triangle[~np.isfinite(distance)] = -1
        return Hits(distance, triangle)
