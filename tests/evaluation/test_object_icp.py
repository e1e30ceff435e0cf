"""Kabsch finds a known motion; ICP finds a small one without partners."""

from __future__ import annotations

import numpy as np

from lidaraccum.evaluation.object_icp import kabsch, refine
from lidaraccum.geometry import rigid


def box_surface() -> np.ndarray:
    rng = np.random.default_rng(3)
    points = rng.uniform(-1, 1, (1500, 3))
    side = rng.integers(0, 3, 1500)
    points[np.arange(1500), side] = np.sign(points[np.arange(1500), side])
    return points * [2.0, 0.9, 0.7]


def test_kabsch_finds_a_known_motion_of_planar_points_too() -> None:
    motion = rigid.exponential(np.array([0.1, -0.2, 1.0, 3.0, -2.0, 0.5]))
    for points in (box_surface(), box_surface() * [1.0, 1.0, 0.0]):
        np.testing.assert_allclose(
            kabsch(points, rigid.transform(motion, points)), motion, atol=1e-9
        )


def test_icp_finds_a_small_motion() -> None:
    points = box_surface()
    motion = rigid.exponential(np.array([0.0, 0.0, 0.02, 0.05, -0.03, 0.01]))
    found = refine(points, rigid.transform(motion, points), np.eye(4))
    np.testing.assert_allclose(found, motion, atol=2e-3)


def test_icp_keeps_the_start_where_nothing_is_near() -> None:
    points = box_surface()
    start = rigid.translation((1.0, 0.0, 0.0))
    np.testing.assert_array_equal(refine(points, points + 50.0, start), start)
