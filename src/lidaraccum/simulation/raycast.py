"""The one door to ray casters: meshes in, nearest hits out. Open3D or embreex, both over Embree."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import MissingDependencyError
from lidaraccum.simulation.mesh import Mesh

_log = logging.getLogger(__name__)


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
    """One mesh made ready for rays. Many threads may cast at once."""

    def cast(self, rays: NDArray[np.float32], /) -> Hits:
        """Nearest hits of rays (N, 6): origin and unit direction in the mesh's coordinates."""


class RayCaster(Protocol):
    """Makes meshes ready for rays. Picklable, so that it can go to worker processes."""

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
        _open_open3d()
        self._threads = threads

    def scene(self, mesh: Mesh) -> RayScene:
        """The mesh in an Embree scene."""
        return _Open3DScene(_open_open3d(), mesh, self._threads)


class EmbreexRayCaster:
    """Embree through the embreex package: a wheel of 15 MB, for machines without open3d.

    A cast runs on the thread that asks for it; building a scene uses the cores that are free.

    Raises:
        MissingDependencyError: When embreex is not installed.
    """

    def __init__(self) -> None:
        _open_embreex()

    def scene(self, mesh: Mesh) -> RayScene:
        """The mesh in an Embree scene."""
        return _EmbreexScene(mesh)


def usual_caster() -> RayCaster:
    """Open3D on one thread where it can be opened, else embreex; the hits are the same.

    Raises:
        MissingDependencyError: When there is neither.
    """
    try:
        return Open3DRayCaster()
    except MissingDependencyError as error:
        _log.debug("%s; trying embreex", error.message)
    try:
        return EmbreexRayCaster()
    except MissingDependencyError as error:
        raise MissingDependencyError(
            "simulation casts its rays with open3d or embreex, and neither can be opened",
            hint="pip install open3d, or the smaller pip install embreex",
        ) from error


def _open_open3d() -> ModuleType:
    try:
        import open3d
    except (ImportError, OSError) as error:  # installed, but a system library is missing: OSError
        raise MissingDependencyError(
            "open3d cannot be opened", hint="pip install open3d"
        ) from error
    return open3d


def _open_embreex() -> tuple[Any, Any]:
    """Its scene and its mesh, as classes."""
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except (ImportError, OSError) as error:
        raise MissingDependencyError(
            "embreex cannot be opened", hint="pip install embreex"
        ) from error
    return EmbreeScene, TriangleMesh


class _Open3DScene:
    def __init__(self, open3d: ModuleType, mesh: Mesh, threads: int) -> None:
        self._tensor = open3d.core.Tensor.from_numpy
        self._threads = threads
        self._scene = open3d.t.geometry.RaycastingScene(nthreads=threads)
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


class _EmbreexScene:
    def __init__(self, mesh: Mesh) -> None:
        make_scene, add_triangles = _open_embreex()
        # Robust, as in Open3D: no ray slips through between two triangles.
        self._scene = make_scene(robust=True)
        self._mesh = add_triangles(self._scene, mesh.vertices, mesh.triangles)
        # The tree is built by the first cast, which two threads must not do at once.
        self.cast(np.array([[0, 0, 0, 0, 0, 1]], dtype=np.float32))

    def cast(self, rays: NDArray[np.float32]) -> Hits:
        answer = self._scene.run(rays[:, :3], rays[:, 3:], output=True)
        triangle = answer["primID"]
        return Hits(np.where(triangle < 0, np.float32(np.inf), answer["tfar"]), triangle)
