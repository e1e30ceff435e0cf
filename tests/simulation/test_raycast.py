"""Any ray caster behind the interface gives the same hits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.drive import DriveSettings, simulate
from lidaraccum.simulation.mesh import Finish, Mesh, blob, box, merge
from lidaraccum.simulation.raycast import Hits, Open3DRayCaster, RayScene
from lidaraccum.simulation.surfaces import Surface

FINISH = Finish(Surface.WALL, 0.5)


class EveryTriangle:
    """Möller and Trumbore's test against every triangle."""

    def __init__(self, mesh: Mesh) -> None:
        self.corners = mesh.corners.astype(np.float64)

    def cast(self, rays: NDArray[np.float32]) -> Hits:
        a, b, c = np.swapaxes(self.corners, 0, 1)
        start, ahead = rays[:, None, :3].astype(np.float64), rays[:, None, 3:].astype(np.float64)
        across = np.cross(ahead, c - a)
        size = np.einsum("nfi,fi->nf", across, b - a)
        size = np.where(np.abs(size) < 1e-12, np.nan, size)
        u = np.einsum("nfi,nfi->nf", start - a, across) / size
        other = np.cross(start - a, b - a)
        v = np.einsum("nfi,nfi->nf", np.broadcast_to(ahead, other.shape), other) / size
        reach = np.einsum("fi,nfi->nf", c - a, other) / size
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (reach > 0)
        reach = np.where(hit, reach, np.inf)
        nearest = reach.argmin(axis=1)
        distance = reach[np.arange(len(rays)), nearest]
        triangle = np.where(np.isfinite(distance), nearest, -1)
        return Hits(distance.astype(np.float32), triangle.astype(np.int32))


def test_open3d_agrees_with_testing_every_triangle() -> None:
    rng = np.random.default_rng(1)
    mesh = merge([box((2, 1, 1), (3, 0, 0), FINISH), blob((1, 1, 1), (0, 4, 0), FINISH, rng)])
    ahead = rng.standard_normal((500, 3))
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    rays = np.concatenate([np.full((500, 3), 0.25), ahead], axis=1).astype(np.float32)
    ours, theirs = EveryTriangle(mesh).cast(rays), Open3DRayCaster().scene(mesh).cast(rays)
    assert np.isfinite(ours.distance).any()
    assert np.array_equal(ours.triangle < 0, theirs.triangle < 0)
    hit = ours.triangle >= 0
    assert np.allclose(ours.distance[hit], theirs.distance[hit], atol=1e-4)


def test_another_caster_can_serve() -> None:
    class Counting:
        """Hands on to Open3D and counts."""

        def __init__(self) -> None:
            self.scenes = 0

        def scene(self, mesh: Mesh) -> RayScene:
            self.scenes += 1
            return Open3DRayCaster().scene(mesh)

    settings = DriveSettings(seed=2, frames=1, sensor="VLP-16", scene="tunnel")
    caster = Counting()
    own, usual = simulate(settings, caster), simulate(settings)
    assert np.array_equal(own[0].points, usual[0].points)
    assert caster.scenes >= 1
