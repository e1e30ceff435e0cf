"""Any ray caster behind the interface gives the same hits."""

from __future__ import annotations

import pickle
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.errors import MissingDependencyError
from lidaraccum.simulation.drive import DriveSettings, simulate
from lidaraccum.simulation.mesh import Finish, Mesh, blob, box, merge
from lidaraccum.simulation.raycast import (
    EmbreexRayCaster,
    Hits,
    Open3DRayCaster,
    RayCaster,
    RayScene,
    usual_caster,
)
from lidaraccum.simulation.surfaces import Surface

FINISH = Finish(Surface.WALL, 0.5)
CASTERS = (Open3DRayCaster, EmbreexRayCaster)


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


def solids() -> Mesh:
    """A box and a lump, neither about the origin."""
    rng = np.random.default_rng(1)
    return merge([box((2, 1, 1), (3, 0, 0), FINISH), blob((1, 1, 1), (0, 4, 0), FINISH, rng)])


def rays_all_round(count: int) -> NDArray[np.float32]:
    ahead = np.random.default_rng(2).standard_normal((count, 3))
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return np.concatenate([np.full((count, 3), 0.25), ahead], axis=1).astype(np.float32)


@pytest.mark.parametrize("caster", CASTERS)
def test_a_caster_agrees_with_testing_every_triangle(caster: type[RayCaster]) -> None:
    mesh, rays = solids(), rays_all_round(500)
    ours, theirs = EveryTriangle(mesh).cast(rays), caster().scene(mesh).cast(rays)
    assert np.isfinite(ours.distance).any()
    assert np.array_equal(ours.triangle, theirs.triangle)
    assert np.array_equal(np.isinf(ours.distance), np.isinf(theirs.distance))
    hit = ours.triangle >= 0
    assert np.allclose(ours.distance[hit], theirs.distance[hit], atol=1e-4)


@pytest.mark.parametrize("caster", CASTERS)
def test_no_rays_meet_nothing(caster: type[RayCaster]) -> None:
    hits = caster().scene(solids()).cast(np.zeros((0, 6), dtype=np.float32))
    assert hits.distance.shape == hits.triangle.shape == (0,)
    assert (hits.distance.dtype, hits.triangle.dtype) == (np.float32, np.int32)


@pytest.mark.parametrize("caster", CASTERS)
def test_a_caster_travels_to_another_process(caster: type[RayCaster]) -> None:
    arrived = pickle.loads(pickle.dumps(caster()))
    rays = rays_all_round(50)
    here, there = (one.scene(solids()).cast(rays) for one in (caster(), arrived))
    assert np.array_equal(here.distance, there.distance)


@pytest.mark.parametrize("caster", CASTERS)
def test_threads_can_cast_at_once(caster: type[RayCaster]) -> None:
    scene, rays = caster().scene(solids()), rays_all_round(4000)
    whole = scene.cast(rays)
    with ThreadPoolExecutor(2) as pool:
        parts = list(pool.map(scene.cast, np.split(rays, 8)))
    assert np.array_equal(whole.distance, np.concatenate([part.distance for part in parts]))
    assert np.array_equal(whole.triangle, np.concatenate([part.triangle for part in parts]))


class Noting:
    """Hands on to a caster and keeps what it answers."""

    def __init__(self, caster: RayCaster) -> None:
        self.caster = caster
        self.answers: list[Hits] = []

    def scene(self, mesh: Mesh) -> RayScene:
        scene, noting = self.caster.scene(mesh), self

        class NotingScene:
            def cast(self, rays: NDArray[np.float32]) -> Hits:
                hits = scene.cast(rays)
                noting.answers.append(Hits(hits.distance.copy(), hits.triangle.copy()))
                return hits

        return NotingScene()


def test_both_casters_give_the_same_frames() -> None:
    settings = DriveSettings(seed=3, frames=2, sensor="VLP-16")
    one, other = Noting(Open3DRayCaster()), Noting(EmbreexRayCaster())
    for mine, its in zip(simulate(settings, one), simulate(settings, other), strict=True):
        assert len(mine) > 1000
        assert np.allclose(mine.points, its.points, atol=1e-4)
    assert len(one.answers) == len(other.answers) > 2
    for hits, others in zip(one.answers, other.answers, strict=True):
        hit = hits.triangle >= 0
        assert np.array_equal(hit, others.triangle >= 0)
        assert (hits.triangle == others.triangle).mean() > 0.999  # an edge belongs to two
        assert np.allclose(hits.distance[hit], others.distance[hit], rtol=0, atol=1e-4)
        assert np.isinf(others.distance[~hit]).all()


def test_without_open3d_embreex_casts(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(usual_caster(), Open3DRayCaster)
    monkeypatch.setitem(sys.modules, "open3d", None)
    assert isinstance(usual_caster(), EmbreexRayCaster)


def test_without_either_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("open3d", "embreex", "embreex.rtcore_scene", "embreex.mesh_construction"):
        monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingDependencyError, match=r"pip install open3d.*pip install embreex"):
        simulate(DriveSettings(seed=3, frames=1))


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
