"""What grows stands on its ground, begins there, and moves nothing else in a world."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import lidaraccum.simulation.world as worlds
from lidaraccum.simulation.growth import (
    carport,
    clipped,
    gate,
    grown_over,
    low_tree,
    shrub,
    wild_hedge,
)
from lidaraccum.simulation.mesh import Mesh
from lidaraccum.simulation.networks import lay_network
from lidaraccum.simulation.surfaces import Surface
from lidaraccum.simulation.vegetation import hedge
from lidaraccum.simulation.world import World, build_world

GREEN = (Surface.HEDGE, Surface.LEAVES)


@pytest.mark.parametrize("maker", [shrub, low_tree, clipped, gate, carport])
def test_single_things_stand_on_the_ground(maker: Callable[..., Mesh]) -> None:
    for seed in range(20):
        mesh = maker(np.random.default_rng(seed))
        low, high = mesh.bounds
        assert np.isfinite(mesh.vertices).all()
        assert -0.5 < low[2] < 0.35
        assert 0.3 < high[2] < 10.0
        assert (high - low)[:2].max() < 10.0


@pytest.mark.parametrize("maker", [shrub, clipped, low_tree])
def test_leaves_begin_at_the_ground(maker: Callable[..., Mesh]) -> None:
    for seed in range(20):
        mesh = maker(np.random.default_rng(seed))
        leaves = mesh.corners[np.isin(mesh.surface, GREEN)].reshape(-1, 3)
        assert np.percentile(leaves[:, 2], 2) < 1.3
        assert len(leaves) > 100


@pytest.mark.parametrize("maker", [wild_hedge, grown_over, hedge])
def test_lines_of_growth_follow_their_ground(maker: Callable[..., Mesh]) -> None:
    along = np.linspace(0, 9, 16)
    line = np.stack([along, 0.1 * along**2, 5.0 + 0.2 * along], axis=1)
    for seed in range(10):
        mesh = maker(line, np.random.default_rng(seed))
        gap = np.linalg.norm(mesh.vertices[:, None, :2] - line[None, :, :2], axis=2)
        above = mesh.vertices[:, 2] - line[gap.argmin(axis=1), 2]
        assert gap.min(axis=1).max() < 3.0
        assert above.min() > -0.8
        assert 0.2 < above.max() < 5.0


def _world(kind: str, green: float = 1.0) -> World:
    rng = np.random.default_rng(5)
    return build_world(lay_network(kind, 10.0, rng), 10.0, rng, green=green)


@pytest.mark.parametrize("kind", ["suburban", "crossing"])
def test_growth_adds_and_moves_nothing(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    grown = _world(kind)
    monkeypatch.setattr(worlds, "overgrow", lambda site, blocks, way, green: None)
    bare = _world(kind)
    count = len(bare.discs)
    assert len(grown.discs) > count
    assert np.array_equal(grown.discs[:count], bare.discs)
    for before, after in zip(bare.stills, grown.stills, strict=False):
        assert before.id == after.id
        assert np.array_equal(before.world_from_object, after.world_from_object)
    assert _green_corners(grown) > 1.2 * _green_corners(bare)


def test_gardens_are_as_green_as_asked() -> None:
    bare, thin, usual, most, more = (
        _green_corners(_world("suburban", green)) for green in (0.0, 0.3, 1.0, 50.0, 100.0)
    )
    assert bare < thin < usual < most == more


def _green_corners(world: World) -> int:
    corners: NDArray[np.float32] = world.mesh.corners[np.isin(world.mesh.surface, GREEN)]
    return int(np.count_nonzero(np.isfinite(corners[:, 0, 0])))
