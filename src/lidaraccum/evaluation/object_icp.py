"""Point-to-point ICP of one object's points onto another frame's: the paper's refinement."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.geometry import rigid

GATE_M = 0.15
"""Pairs farther apart do not count; the paper, test-time refinement on Waymo."""
ITERATIONS = 30
STOP_M = 1e-4
MIN_PAIRS = 6


def refine(
    source: NDArray[np.float64], target: NDArray[np.float64], start: rigid.Pose
) -> rigid.Pose:
    """The motion (4, 4) near ``start`` that lays points (N, 3) onto points (M, 3), metres.

    Besl and McKay (PAMI 1992). Never rejects what it finds, as the authors' code never does.
    """
    tree, motion = cKDTree(target), start
    for _ in range(ITERATIONS):
        moved = rigid.transform(motion, source)
        distance, row = tree.query(moved, distance_upper_bound=GATE_M)
        close = np.isfinite(distance)
        if np.count_nonzero(close) < MIN_PAIRS:
            return motion
        step = kabsch(moved[close], target[row[close]])
        motion = step @ motion
        if np.abs(rigid.transform(step, moved) - moved).max() < STOP_M:
            return motion
    return motion


def kabsch(source: NDArray[np.float64], target: NDArray[np.float64]) -> rigid.Pose:
    """The motion (4, 4) that takes points (N, 3) to their partners (N, 3) with least squares."""
    middle, goal = source.mean(axis=0), target.mean(axis=0)
    left, _, right = np.linalg.svd((target - goal).T @ (source - middle))
    proper = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    motion = np.eye(4)
    motion[:3, :3] = left @ proper @ right
    motion[:3, 3] = goal - motion[:3, :3] @ middle
    return motion
