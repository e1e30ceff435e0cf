"""What stands right beside the ego's way is of both sorts, leaves it free, and moves nothing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.simulation.beside import AHEAD_M, BEHIND_M, EGO_HALF_M, GAPS_M
from lidaraccum.simulation.drive import DriveSettings, simulate
from lidaraccum.simulation.networks import lay_network
from lidaraccum.simulation.world import Filling, World, build_world

SCENES = ("straight", "curved", "crossing", "suburban", "highway", "square", "rural")
REACH_M = 20.0


def _world(kind: str, beside: float) -> World:
    network = lay_network(kind, REACH_M, np.random.default_rng(5))
    return build_world(network, REACH_M, np.random.default_rng(6), Filling(beside=beside))


@pytest.fixture(scope="module")
def pairs() -> dict[str, tuple[World, World]]:
    """Worlds of each kind without and with such things."""
    return {kind: (_world(kind, 0.0), _world(kind, 6.0)) for kind in SCENES}


def _gap(world: World, spots: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) metres from places (N, 2) to the line on which the ego drives."""
    network = world.network
    along = network.ego_start + np.arange(-BEHIND_M - 15.0, REACH_M + AHEAD_M + 15.0, 0.1)
    way = network.ego.at(along)[0]
    return np.min(np.linalg.norm(spots[:, None] - way, axis=2), axis=1)


@pytest.mark.parametrize("kind", SCENES)
def test_all_else_stands_where_it_stood(pairs: dict[str, tuple[World, World]], kind: str) -> None:
    bare, crowded = pairs[kind]
    first = len(bare.stills)
    for old, new in zip(bare.stills, crowded.stills[:first], strict=True):
        assert np.array_equal(old.world_from_object, new.world_from_object)
        assert np.array_equal(old.model.mesh.vertices, new.model.mesh.vertices)
    assert np.array_equal(crowded.discs[: len(bare.discs)], bare.discs)


def test_what_is_added_stands_close_by_and_not_in_the_way(
    pairs: dict[str, tuple[World, World]],
) -> None:
    movable = standing = 0
    for bare, crowded in pairs.values():
        added = crowded.stills[len(bare.stills) :]
        for still in added:
            corners = still.model.mesh.posed(still.world_from_object).vertices[:, :2]
            gap = _gap(crowded, corners.astype(np.float64))
            assert EGO_HALF_M - 0.35 < gap.min() < EGO_HALF_M + GAPS_M[1] + 0.5
        discs = crowded.discs[len(bare.discs) :]
        assert (_gap(crowded, discs[:, :2]) > EGO_HALF_M).all()
        movable += len(added)
        standing += len(crowded.mesh) > len(bare.mesh)
    assert movable >= 10
    assert standing >= 5


def test_the_sensor_sees_it_on_drives_that_ask() -> None:
    def near(beside: float) -> tuple[int, int]:
        counts = np.zeros(2, dtype=np.int64)
        for seed in range(4):
            drive = simulate(
                DriveSettings(
                    seed=seed, frames=1, sensor="VLP-32C", scene="rural", speed_mps=5.0,
                    beside=beside, coordinates="sensor", zeros=False,
                )
            )  # fmt: skip
            frame, labels = drive[0], drive.labels(0)
            assert labels.annotated is not None
            close = np.hypot(frame.points[:, 0], frame.points[:, 1]) < 5.0
            close &= (frame.points[:, 2] > -1.0) & labels.annotated
            counts += (close & labels.foreground).sum(), (close & ~labels.foreground).sum()
        return int(counts[0]), int(counts[1])

    usual, crowded = near(0.0), near(6.0)
    assert crowded[0] > 1.5 * usual[0]
    assert crowded[1] > 1.5 * usual[1]
