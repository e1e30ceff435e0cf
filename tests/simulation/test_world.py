"""Worlds of every kind stand on their ground and keep their roads free."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.simulation.motion import poses_of
from lidaraccum.simulation.networks import SCENE_KINDS, lay_network
from lidaraccum.simulation.surfaces import Surface
from lidaraccum.simulation.world import Filling, build_world


@pytest.mark.parametrize("kind", SCENE_KINDS)
def test_worlds_are_whole_and_roads_are_free(kind: str) -> None:
    rng = np.random.default_rng(7)
    network = lay_network(kind, 10.0, rng)
    world = build_world(network, 10.0, rng)
    mesh = world.mesh
    assert np.isfinite(mesh.vertices).all()
    assert len(mesh) == len(world.instance) == len(mesh.surface) == len(mesh.reflectivity)
    assert mesh.triangles.max() < len(mesh.vertices)
    ids = [still.id for still in world.stills]
    assert ids == list(range(1, len(ids) + 1))
    assert set(np.unique(world.instance)) <= {0, *ids}
    way, _ = network.ego.at(network.ego_start + np.linspace(0, 10, 30))
    gap = np.linalg.norm(way[:, None] - world.discs[None, :, :2], axis=2) - world.discs[:, 2]
    assert gap.min() > 0.6
    assert {Surface.ROAD, Surface.LEAVES} & set(np.unique(mesh.surface))


@pytest.mark.parametrize("kind", ["crossing", "square", "roundabout", "industrial"])
def test_without_street_furniture_nothing_of_it_stands_about(kind: str) -> None:
    furnished, bare = (
        build_world(
            lay_network(kind, 10.0, np.random.default_rng(5)),
            10.0,
            np.random.default_rng(5),
            Filling(furniture=furniture, beside=6.0),
        )
        for furniture in (True, False)
    )
    kinds = [set(np.unique(world.mesh.surface)) for world in (furnished, bare)]
    assert Surface.FURNITURE in kinds[0]
    assert Surface.FURNITURE not in kinds[1]
    assert {Surface.ROAD, Surface.LEAVES} & kinds[1]
    assert bare.stills, "what is parked is no furniture"


def test_the_ground_is_where_its_height_says() -> None:
    rng = np.random.default_rng(3)
    network = lay_network("rural", 10.0, rng)
    world = build_world(network, 10.0, rng)
    ground = np.isin(world.mesh.surface, [Surface.ROAD])
    corners = world.mesh.corners[ground]
    share = rng.dirichlet(np.ones(3), len(corners))
    inside = np.einsum("fk,fki->fi", share, corners)
    assert np.abs(world.terrain.height(inside[:, :2]) - inside[:, 2]).max() < 0.002


def test_poses_turn_by_yaw_then_pitch_then_roll() -> None:
    ahead = poses_of(np.zeros((1, 3)), np.array([[np.pi / 2, 0, 0]]))[0] @ [1, 0, 0, 1]
    assert np.allclose(ahead[:3], [0, 1, 0])
    nose = poses_of(np.zeros((1, 3)), np.array([[0, 0.1, 0]]))[0] @ [1, 0, 0, 1]
    assert nose[2] < 0
    left = poses_of(np.zeros((1, 3)), np.array([[0, 0, 0.1]]))[0] @ [0, 1, 0, 1]
    assert left[2] > 0
