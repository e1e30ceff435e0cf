"""Voxels: integer cells of space packed into one 64-bit key each."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.order import sorted_rows

Keys = NDArray[np.int64]

_BITS = 21
_HALF = 1 << (_BITS - 1)
_MASK = (1 << _BITS) - 1
_MOST = 1 << 62
_ZERO_KEY = (_HALF << (2 * _BITS)) | (_HALF << _BITS) | _HALF


def voxel_keys(points: NDArray[Any], size_m: float) -> Keys:
    """Key (N,) of the cubic voxel, ``size_m`` wide, that each point (N, 3) lies in.

    Sorted keys are sorted by x, then y, then z. Cells repeat beyond a million voxels from 0.
    """
    return cell_keys(np.floor(points * (1.0 / size_m)).astype(np.int64))


def voxel_cells(keys: Keys) -> NDArray[np.int64]:
    """Integer cells (N, 3) of keys (N,): the floor of position over voxel size."""
    return np.stack([keys >> (2 * _BITS), (keys >> _BITS) & _MASK, keys & _MASK], axis=1) - _HALF


def cell_keys(cells: NDArray[np.int64]) -> Keys:
    """Keys (N,) of integer cells (N, 3): the inverse of `voxel_cells`."""
    x, y, z = cells.T
    keys = (x << _BITS) + y
    keys <<= _BITS
    keys += z
    keys += _ZERO_KEY
    return keys


def voxel_centres(keys: Keys, size_m: float) -> NDArray[np.float64]:
    """Centres (N, 3) of the voxels, metres."""
    return (voxel_cells(keys).astype(np.float64) + 0.5) * size_m


def group_by_key(keys: Keys) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """An order (N,) that sorts keys (N,), and where each group of equal keys starts in it (V,)."""
    order = np.argsort(keys)
    return order, _changes(keys.take(order))


def group_by_cell(cells: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The same for whole-numbered cells (3, N), sorted by x, then y, then z."""
    first = cells.min(axis=1, keepdims=True)
    _, wide, high = extent = [
        int(one) + 1 for one in (cells.max(axis=1, keepdims=True) - first).ravel()
    ]
    if math.prod(extent) * cells.shape[1] >= _MOST:
        return group_by_key(cell_keys(cells.T.astype(np.int64)))
    x, y, z = (cells - first).astype(np.int32)
    numbers = x.astype(np.int64)
    numbers *= wide
    numbers += y
    numbers *= high
    numbers += z
    order, ordered = sorted_rows(numbers)
    return order, _changes(ordered)


def thin(points: NDArray[Any], size_m: float) -> NDArray[np.int64]:
    """Rows (V,) of one point per voxel: the one nearest to the voxel's centre.

    Which points are kept does not depend on their order; rows come sorted by voxel.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.int64)
    scaled = np.ascontiguousarray(points.T) * (1.0 / size_m)
    cells = np.floor(scaled)
    x, y, z = scaled - cells - 0.5
    away = x * x + y * y + z * z
    order, starts = group_by_cell(cells)
    away = away.take(order)
    counts = np.diff(starts, append=len(order))
    nearest = np.flatnonzero(away == np.repeat(np.minimum.reduceat(away, starts), counts))
    voxel_of_nearest = np.searchsorted(starts, nearest, side="right")
    return order[nearest[_changes(voxel_of_nearest)]]


def _changes(ordered: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where each run of equal values begins, in values (N,) that come in runs."""
    is_first = np.ones(len(ordered), dtype=np.bool_)
    np.not_equal(ordered[1:], ordered[:-1], out=is_first[1:])
    return np.flatnonzero(is_first)
