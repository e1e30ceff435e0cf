"""What grows stands on its ground, begins there, and moves nothing else in a world."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import lidaraccum.simulation.world as worlds
from lidaraccum.simulation.drive import DriveSettings, simulate
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
from lidaraccum.simulation.thicket import Thickets
from lidaraccum.simulation.vegetation import bush, hedge
from lidaraccum.simulation.world import Filling, World, build_world

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
    return build_world(lay_network(kind, 10.0, rng), 10.0, rng, Filling(green=green))


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


def test_thickets_fill_the_place_of_what_is_loose() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        loose = (shrub, bush, clipped, low_tree)[seed % 4](rng)
        dense = Thickets(1.0, rng).body(shrub, loose)
        (low, high), (least, most) = loose.bounds, dense.bounds
        assert set(dense.surface) == {Surface.THICKET}
        assert np.abs(least[:2] - low[:2]).max() < 0.7
        assert np.abs(most - high).max() < 0.7
        assert -0.7 < least[2] < 0.3


def test_a_dense_hedge_follows_its_ground() -> None:
    along = np.linspace(0, 9, 16)
    line = np.stack([along, 0.1 * along**2, 5.0 + 0.2 * along], axis=1)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        mesh = Thickets(1.0, rng).line(hedge, hedge(line, rng), line)
        gap = np.linalg.norm(mesh.vertices[:, None, :2] - line[None, :, :2], axis=2)
        above = mesh.vertices[:, 2] - line[gap.argmin(axis=1), 2]
        assert set(mesh.surface) == {Surface.THICKET}
        assert gap.min(axis=1).max() < 2.5
        assert above.min() > -1.0
        assert 0.4 < above.max() < 5.0


def test_only_plants_grow_densely_and_only_as_many_as_asked() -> None:
    rng = np.random.default_rng(3)
    loose, ivy = shrub(rng), grown_over(np.eye(4, 3), rng)
    assert Thickets(1.0, rng).line(grown_over, ivy, np.eye(4, 3)) is ivy
    assert Thickets(0.0, rng).body(shrub, loose) is loose
    some = [Thickets(0.5, rng).body(shrub, loose) is loose for _ in range(400)]
    assert 0.4 < np.mean(some) < 0.6


def _jumps(dense: float) -> NDArray[np.float64]:
    """How far ranges of neighbouring pulses on plants lie apart, metres."""
    found = []
    for seed in (3, 8, 14):
        settings = DriveSettings(
            seed=seed, frames=1, sensor="HDL-64E", scene="suburban", speed_mps=0.0, dense=dense,
            green=5.0, weather="clear", zeros=False, coordinates="sensor", rolling_shutter=False,
        )  # fmt: skip
        drive = simulate(settings)
        frame, labels = drive[0], drive.labels(0)
        assert frame.ring is not None
        assert labels.semantic is not None
        ways = np.arctan2(frame.points[:, 1], frame.points[:, 0])
        order = np.lexsort((ways, frame.ring))
        ranges = np.linalg.norm(frame.points[order].astype(np.float64), axis=1)
        plant = np.isin(labels.semantic[order], (*GREEN, Surface.THICKET))
        beside = plant[1:] & plant[:-1] & (np.diff(ways[order]) < 0.004) & (ranges[1:] < 25.0)
        found.append(np.abs(np.diff(ranges))[beside & (np.diff(frame.ring[order]) == 0)])
    return np.concatenate(found)


def test_what_grows_densely_is_smoother_than_leaves_about_a_core() -> None:
    loose, dense = _jumps(0.0), _jumps(1.0)
    assert len(loose) > 1000
    assert np.mean(dense > 0.3) < 0.5 * np.mean(loose > 0.3)
    assert np.median(dense) < 0.8 * np.median(loose)
