"""What the simulator's tests share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import open3d as o3d
import pytest
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Mesh

Distance = Callable[[Mesh, NDArray[np.float64]], NDArray[np.float64]]


@pytest.fixture(scope="session")
def distance_to() -> Distance:
    """Metres (N,) of points (N, 3) from a mesh's nearest triangle."""

    def measure(mesh: Mesh, points: NDArray[np.float64]) -> NDArray[np.float64]:
        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        tensor = o3d.core.Tensor.from_numpy
        scene.add_triangles(tensor(mesh.vertices), tensor(mesh.triangles.astype(np.uint32)))
        return scene.compute_distance(tensor(points.astype(np.float32)), nthreads=1).numpy()

    return measure
