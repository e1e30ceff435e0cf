"""What all frames together say of a place: views of the same thing outvote a single one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.voxel import Keys, voxel_keys

CELL_M = 0.5
"""Places are cells so wide, seen from above."""

MOST_POINTS = 50
NEAREST_M = 5.0
"""A frame's say of a cell counts by its points there, no more than so many, over their distance,
no less than this: what is near shows its shape, in every point."""

REMEMBERED_FRAMES = 100
"""A cell that no frame saw for so long is forgotten."""


class Places:
    """How likely what stands in a cell can move, by all frames that looked there."""

    def __init__(self) -> None:
        self._keys = np.zeros(0, dtype=np.int64)
        self._weight = np.zeros(0)
        self._movable = np.zeros(0)
        self._seen = np.zeros(0, dtype=np.int64)
        self._now = 0

    def note(
        self,
        places: NDArray[np.float64],
        probability: NDArray[np.float32],
        ranges: NDArray[np.floating],
    ) -> None:
        """Hear a frame: points at (N, 2) metres, world, movable with a probability (N,).

        ``ranges`` (N,) are their distances from the sensor, metres.
        """
        keys, cell, counts = np.unique(cell_keys(places), return_inverse=True, return_counts=True)
        distance = np.maximum(np.bincount(cell, ranges) / counts, NEAREST_M)
        weight = np.minimum(counts, MOST_POINTS) / distance
        movable = weight * (np.bincount(cell, probability) / counts)
        self._now += 1
        known = self._seen > self._now - REMEMBERED_FRAMES
        self._keys, place = np.unique(
            np.concatenate([self._keys[known], keys]), return_inverse=True
        )
        self._weight = _sums(place, np.concatenate([self._weight[known], weight]))
        self._movable = _sums(place, np.concatenate([self._movable[known], movable]))
        seen = np.zeros(len(self._keys), dtype=np.int64)
        seen[place] = np.concatenate([self._seen[known], np.full(len(keys), self._now)])
        self._seen = seen

    def probability(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """How likely points at (N, 2) metres, world, in places heard of, are movable: (N,)."""
        at = np.searchsorted(self._keys, cell_keys(places))
        return self._movable[at] / self._weight[at]


def _sums(place: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.bincount(place, values).astype(np.float64, copy=False)


def cell_keys(places: NDArray[np.float64]) -> Keys:
    """A number (N,) for the cell of each place (N, 2), metres, sorted by x, then y."""
    return voxel_keys(np.column_stack([places, np.zeros(len(places))]), CELL_M)
