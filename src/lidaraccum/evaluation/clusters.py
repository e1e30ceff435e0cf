"""Objects from points that are known to be movable: density clustering of a window or a frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.clustering import dbscan
from lidaraccum.geometry.voxel import voxel_keys

VOXEL_M = 0.15
"""The paper, section 3.3: points are thinned before they are clustered."""
RADIUS_M = 0.4
NEIGHBOURS = 5
"""Radius and least number of neighbours of DBSCAN, seen from above; METHOD.md section 4."""
MIN_VOXELS = 15
"""Clusters of fewer voxels are dropped; same source."""

Points = NDArray[np.float64]
Ids = NDArray[np.int32]


def cluster_points(points: Points, min_voxels: int = MIN_VOXELS) -> Ids:
    """Object (N,), 0 for none, counted from 1, of points (N, 3), metres."""
    if len(points) == 0:
        return np.zeros(0, dtype=np.int32)
    _, first, voxel = np.unique(voxel_keys(points, VOXEL_M), return_index=True, return_inverse=True)
    cluster = dbscan(points[first, :2], RADIUS_M, NEIGHBOURS)
    sizes = np.bincount(cluster[cluster >= 0], minlength=1)
    kept = np.flatnonzero(sizes >= min_voxels)
    number = np.zeros(len(sizes) + 1, dtype=np.int32)
    number[kept] = np.arange(1, len(kept) + 1)
    return number[cluster][voxel]


def cluster_window(frames: Sequence[Points]) -> list[Ids]:
    """Objects of all frames' points (N_t, 3), world, clustered together: one id an object."""
    ids = cluster_points(np.concatenate(list(frames)))
    ends = np.cumsum([len(points) for points in frames])[:-1]
    return list(np.split(ids, ends))
