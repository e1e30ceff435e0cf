"""Groups of points that hang together, seen from above."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

_EIGHT = np.ones((3, 3), dtype=np.int8)


def connected_cells(positions: NDArray[Any], cell_m: float) -> NDArray[np.int64]:
    """Cluster (N,), from 0, of points (N, 2) or (N, 3) by connected square cells seen from above.

    Cells that share an edge or a corner belong together, so gaps up to ``cell_m`` never part two
    points and gaps over twice that always do. Every point has a cluster; linear time.
    """
    if len(positions) == 0:
        return np.zeros(0, dtype=np.int64)
    rows, columns = (
        np.floor(np.ascontiguousarray(axis) * (1.0 / cell_m)).astype(np.int64)
        for axis in (positions[:, 0], positions[:, 1])
    )
    rows -= rows.min()
    columns -= columns.min()
    height, width = int(rows.max()) + 1, int(columns.max()) + 1
    cells = rows * width + columns
    taken = np.zeros(height * width, dtype=np.int8)
    taken[cells] = 1
    named, _ = ndimage.label(taken.reshape(height, width), structure=_EIGHT)
    return named.ravel().take(cells).astype(np.int64) - 1


def dbscan(
    positions: NDArray[Any],
    radius_m: float,
    neighbours: int,
    weights: NDArray[np.int64] | None = None,
) -> NDArray[np.int64]:
    """Cluster (N,), -1 for noise, of positions (N, D).

    Ester et al., "A density-based algorithm" (KDD 1996); a point counts among its neighbours. With
    ``weights`` (N,) a position stands for so many points.
    """
    cluster = np.full(len(positions), -1, dtype=np.int64)
    if len(positions) == 0:
        return cluster
    weights = np.ones(len(positions), dtype=np.int64) if weights is None else weights
    one, two = cKDTree(positions).query_pairs(radius_m, output_type="ndarray").T
    counts = weights.astype(np.float64)
    for own, other in ((one, two), (two, one)):
        counts += np.bincount(own, weights[other], minlength=len(positions))
    core = counts >= neighbours
    both = core[one] & core[two]
    links = coo_matrix(
        (np.ones(int(both.sum())), (one[both], two[both])), shape=(len(positions),) * 2
    )
    _, named = connected_components(links, directed=False)
    _, cluster[core] = np.unique(named[core], return_inverse=True)
    for inner, border in ((one, two), (two, one)):
        joins = core[inner] & ~core[border]
        cluster[border[joins]] = cluster[inner[joins]]
    return cluster


def dense_groups(
    positions: NDArray[Any], cell_m: float, radius_m: float, neighbours: int
) -> NDArray[np.int64]:
    """Cluster (N,), from 0, -1 for noise, of positions (N, 2): `dbscan` of the cells they fill.

    Points of one cell, ``cell_m`` wide, are taken together at their mean, so that many points in
    one place (votes for a centre) cost no more than a few.
    """
    if len(positions) == 0:
        return np.zeros(0, dtype=np.int64)
    cells = np.floor(positions * (1.0 / cell_m)).astype(np.int64)
    cells -= cells.min(axis=0)
    keys = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    _, cell, counts = np.unique(keys, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(cell, axis) / counts for axis in positions.T], axis=1)
    return dbscan(means, radius_m, neighbours, counts)[cell]
