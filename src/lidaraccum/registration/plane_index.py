"""Which plane a point falls on: one look-up for voxels of every size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import voxel

_NO_PLANE = -1
_NO_BLOCK = np.iinfo(np.int64).max


@dataclass(frozen=True, eq=False)
class Matches:
    """Points and the planes they fell on.

    Attributes:
        rows: (M,) which of the points found a plane.
        places: (3, M) those points, metres, world.
        anchors: (3, M) a point of each plane: the mean of what the voxel saw, metres, world.
        normals: (3, M) unit normals of those planes, world.
        distances: (M,) signed distances point to plane, metres.
        weights: (M,) 0..1: 1 for planes as thin as the sensor's noise.
    """

    rows: NDArray[np.int64]
    places: NDArray[np.float64]
    anchors: NDArray[np.float64]
    normals: NDArray[np.float64]
    distances: NDArray[np.float64]
    weights: NDArray[np.float64]


class PlaneIndex:
    """The planes of voxels of several sizes, and at every place the finest that is there.

    Voxels of the coarsest size are blocks, found by their keys; each is cut into cells of the
    finest size, and each cell knows its plane.

    Args:
        voxels: Keys (P,) and planes (7, P: mean, normal, weight) of each size, coarsest first;
            each size is half the one before.
        coarsest_m: Edge of the coarsest voxels.
        origin: (3,) whence keys and means count, world: a corner of the coarsest voxels.
    """

    def __init__(
        self,
        voxels: Sequence[tuple[voxel.Keys, NDArray[np.float64]]],
        coarsest_m: float,
        origin: NDArray[np.float64],
    ) -> None:
        self._halvings = len(voxels) - 1
        self._finest_m = coarsest_m / 2**self._halvings
        self._first = np.round(origin / self._finest_m).astype(np.int64)[:, None]
        self._planes = np.concatenate([planes for _, planes in voxels], axis=1)
        self._planes[:3] += origin[:, None]
        cells = [voxel.voxel_cells(keys).T for keys, _ in voxels]
        blocks = [_block_keys(one, halvings) for halvings, one in enumerate(cells)]
        self._blocks = np.append(np.unique(np.concatenate(blocks)), _NO_BLOCK)
        table = np.full((len(self._blocks), 1), _NO_PLANE, dtype=np.int32)
        known = 0
        for halvings, (one, block) in enumerate(zip(cells, blocks, strict=True)):
            if halvings > 0:
                table = table.take(_enclosing(halvings), axis=1)
            numbers = np.arange(known, known + len(block))
            table[np.searchsorted(self._blocks, block), _cell_numbers(one, halvings)] = numbers
            known += len(block)
        self._table = table.ravel()

    def match(self, places: NDArray[np.float64]) -> Matches:
        """Planes under places (3, N), metres, world coordinates."""
        cells = np.floor(places * (1.0 / self._finest_m)).astype(np.int64) - self._first
        keys = _block_keys(cells, self._halvings)
        block = np.searchsorted(self._blocks, keys)
        cell = (block << 3 * self._halvings) | _cell_numbers(cells, self._halvings)
        number = self._table.take(cell)
        rows = np.flatnonzero((self._blocks.take(block) == keys) & (number != _NO_PLANE))
        planes = self._planes.take(number.take(rows), axis=1)
        found, anchors, normals = places.take(rows, axis=1), planes[:3], planes[3:6]
        distances = np.einsum("ij,ij->j", found - anchors, normals)
        return Matches(rows, found, anchors, normals, distances, planes[6])


def _block_keys(cells: NDArray[np.int64], halvings: int) -> voxel.Keys:
    """Keys (P,) of the blocks around cells (3, P) whose edge is so many times half as long."""
    return voxel.cell_keys((cells >> halvings).T)


def _cell_numbers(cells: NDArray[np.int64], halvings: int) -> NDArray[np.int64]:
    """Number (P,), within their block, of cells (3, P) whose edge is so many times half as long."""
    x, y, z = cells & ((1 << halvings) - 1)
    return (((x << halvings) | y) << halvings) | z


def _enclosing(halvings: int) -> NDArray[np.int64]:
    """For every cell of a block, by number, the number of the cell twice as large around it."""
    edge = np.arange(1 << halvings) >> 1
    return _cell_numbers(
        np.array(np.meshgrid(edge, edge, edge, indexing="ij")), halvings - 1
    ).ravel()
