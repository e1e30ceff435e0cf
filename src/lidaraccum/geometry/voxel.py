"""Voxels: integer cells of space packed into one 64-bit key each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Keys = NDArray[np.int64]

_BITS = 21
_HALF = 1 << (_BITS - 1)
_MASK = (1 << _BITS) - 1


def voxel_keys(points: NDArray[Any], size_m: float) -> Keys:
    """Key (N,) of the cubic voxel, ``size_m`` wide, that each point (N, 3) lies in.

    Sorted keys are sorted by x, then y, then z. Cells repeat beyond a million voxels from 0.
    """
    cell = np.floor(points * (1.0 / size_m)).astype(np.int64) + _HALF
    return (cell[:, 0] << (2 * _BITS)) | (cell[:, 1] << _BITS) | cell[:, 2]


def voxel_cells(keys: Keys) -> NDArray[np.int64]:
    """Integer cells (N, 3) of keys (N,): the floor of position over voxel size."""
    return np.stack([keys >> (2 * _BITS), (keys >> _BITS) & _MASK, keys & _MASK], axis=1) - _HALF


def cell_keys(cells: NDArray[np.int64]) -> Keys:
    """Keys (N,) of integer cells (N, 3): the inverse of `voxel_cells`."""
    shifted = cells + _HALF
    return (shifted[:, 0] << (2 * _BITS)) | (shifted[:, 1] << _BITS) | shifted[:, 2]


def voxel_centres(keys: Keys, size_m: float) -> NDArray[np.float64]:
    """Centres (N, 3) of the voxels, metres."""
    return (voxel_cells(keys).astype(np.float64) + 0.5) * size_m


def group_by_key(keys: Keys) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """An order (N,) that sorts keys (N,), and where each group of equal keys starts in it (V,)."""
    order = np.argsort(keys)
    ordered = keys[order]
    is_first = np.ones(len(keys), dtype=np.bool_)
    is_first[1:] = ordered[1:] != ordered[:-1]
    return order, np.flatnonzero(is_first)


def thin(points: NDArray[Any], size_m: float) -> NDArray[np.int64]:
    """Rows (V,) of one point per voxel: the one nearest to the voxel's centre.

    Which points are kept does not depend on their order; rows come sorted by voxel.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.int64)
    keys = voxel_keys(points, size_m)
    scaled = points * (1.0 / size_m)
    away = ((scaled - np.floor(scaled) - 0.5) ** 2).sum(axis=1)
    order, starts = group_by_key(keys)
    away = away[order]
    counts = np.diff(np.append(starts, len(keys)))
    nearest = np.flatnonzero(away == np.repeat(np.minimum.reduceat(away, starts), counts))
    voxel_of_nearest = np.searchsorted(starts, nearest, side="right")
    first_of_voxel = np.ones(len(nearest), dtype=np.bool_)
    first_of_voxel[1:] = voxel_of_nearest[1:] != voxel_of_nearest[:-1]
    return order[nearest[first_of_voxel]]
