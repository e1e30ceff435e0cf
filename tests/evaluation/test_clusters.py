"""Density clusters: what hangs together, whatever the order."""

from __future__ import annotations

import numpy as np

from lidaraccum.evaluation.clusters import cluster_points, cluster_window


def blobs() -> np.ndarray:
    """Two cars' worth of points, 5 m apart, and a handful of strays."""
    rng = np.random.default_rng(0)
    body = rng.uniform(0, 1, (2000, 3)) * [4.0, 1.8, 1.5]
    return np.concatenate([body, body + np.array([0.0, 6.8, 0.0]), rng.uniform(20, 80, (10, 3))])


def test_two_bodies_are_two_objects_and_strays_are_none() -> None:
    ids = cluster_points(blobs())
    assert set(ids[:2000].tolist()) == {1} or set(ids[:2000].tolist()) == {2}
    assert len(set(ids[:4000].tolist())) == 2
    assert not ids[4000:].any()


def test_the_order_of_points_does_not_matter() -> None:
    points = blobs()
    order = np.random.default_rng(1).permutation(len(points))
    straight, shuffled = cluster_points(points), cluster_points(points[order])
    same = straight[order][:, None] == straight[order][None, :400]
    assert ((shuffled[:, None] == shuffled[None, :400]) == same).all()


def test_frames_of_a_window_share_their_objects() -> None:
    points = blobs()[:2000]
    near, far = cluster_window([points, points + np.array([0.5, 0.0, 0.0])])
    assert set(near.tolist()) == set(far.tolist()) == {1}
    assert [len(ids) for ids in cluster_window([points[:0], points])] == [0, 2000]
