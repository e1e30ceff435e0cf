"""What touches is one; what is apart is not; order does not matter."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry.clustering import connected_cells, dbscan


def blob(x: float, y: float) -> np.ndarray:
    rng = np.random.default_rng(4)
    return rng.uniform(-0.5, 0.5, (200, 3)) + np.array([x, y, 0.0])


@pytest.mark.parametrize("gap", [0.7, 2.0, 30.0])
def test_a_gap_of_more_than_two_cells_parts(gap: float) -> None:
    cluster = connected_cells(np.concatenate([blob(0, 0), blob(1.0 + gap, 0)]), 0.3)
    assert len(set(cluster[:200])) == 1
    assert len(set(cluster[200:])) == 1
    assert cluster[0] != cluster[200]


def test_a_chain_of_near_points_is_one_cluster_whatever_its_heights() -> None:
    chain = np.column_stack([np.arange(0, 20, 0.25), np.zeros(80), np.linspace(0, 50, 80)])
    assert (connected_cells(chain, 0.3) == 0).all()


def test_order_changes_names_of_none_of_the_groups() -> None:
    points = np.concatenate([blob(0, 0), blob(5, 0), blob(0, 5)])
    order = np.random.default_rng(5).permutation(len(points))
    cluster, again = connected_cells(points, 0.3), connected_cells(points[order], 0.3)
    assert (cluster[order] == again).all()


def test_no_points_have_no_clusters() -> None:
    assert connected_cells(np.zeros((0, 3)), 0.3).shape == (0,)


def test_dbscan_joins_chains_takes_in_borders_and_leaves_noise() -> None:
    chain = np.column_stack([np.arange(0, 2, 0.1), np.zeros(20)])
    border, lonely = [[2.25, 0.0]], [[9.0, 9.0]]
    found = dbscan(np.concatenate([chain, border, lonely]), 0.4, 5)
    assert set(found[:21].tolist()) == {0}
    assert found[21] == -1


def test_dbscan_asks_for_enough_neighbours() -> None:
    four = np.array([[0.0, 0], [0.1, 0], [0, 0.1], [0.1, 0.1]])
    assert dbscan(four, 0.4, 5).tolist() == [-1] * 4
    assert dbscan(four, 0.4, 4).tolist() == [0] * 4
    assert dbscan(np.zeros((0, 2)), 0.4, 4).shape == (0,)


def test_a_weight_stands_for_as_many_points() -> None:
    rng = np.random.default_rng(6)
    places, weights = rng.uniform(0, 3, (60, 2)), rng.integers(1, 4, 60)
    heaped = dbscan(np.repeat(places, weights, axis=0), 0.2, 6)
    first = np.cumsum(weights) - weights
    assert ((dbscan(places, 0.2, 6, weights) < 0) == (heaped[first] < 0)).all()
