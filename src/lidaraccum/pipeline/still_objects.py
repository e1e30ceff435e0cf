"""Names for what stands: an id for each place in the world, kept through the drive."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Sequence, Set

import numpy as np
from numpy.typing import NDArray

from lidaraccum.pipeline.object_ids import ObjectIds
from lidaraccum.pipeline.places import cell_keys

LEAST_SHARE = 0.1
"""A cluster is the object that has most of its cells, if that is at least this share of them."""

MOVER_SHARE = 0.5
"""The same of what moves in that very frame: a wall beside it is not to go along."""

MOST_OBJECTS = 4000
MOST_CELLS = 400
"""So many objects are remembered, the latest seen, with so many cells each: some 100 MB."""


class StillObjects:
    """Whose place is whose. What stands is where it was; what moves takes its place along."""

    def __init__(self, ids: ObjectIds) -> None:
        self._ids = ids
        self._owner: dict[int, int] = {}
        self._cells: OrderedDict[int, set[int]] = OrderedDict()

    def name(
        self, clusters: Sequence[NDArray[np.float64]], moving: Set[int] = frozenset()
    ) -> list[int]:
        """Ids of one frame's clusters, each of points (K, 2), metres, world.

        Two clusters never share an id; the larger chooses first. ``moving`` are the ids of what
        moves in this frame, whose points all go where it goes.
        """
        cells = [_cells(cluster) for cluster in clusters]
        names = [0] * len(clusters)
        given: set[int] = set()
        for number in sorted(range(len(clusters)), key=lambda one: -len(clusters[one])):
            name = self._known(cells[number], given, moving) or self._ids.new()
            given.add(name)
            names[number] = name
            self._claim(name, cells[number])
        self._forget()
        return names

    def follow(self, instance: int, points: NDArray[np.float64]) -> None:
        """A mover is at points (K, 2), metres, world, and no longer where it was."""
        for cell in self._cells.pop(instance, set()):
            del self._owner[cell]
        self._claim(instance, _cells(points))

    def _known(self, cells: set[int], given: set[int], moving: Set[int]) -> int | None:
        votes = Counter(self._owner[cell] for cell in cells if cell in self._owner)
        for name, count in votes.most_common():
            share = MOVER_SHARE if name in moving else LEAST_SHARE
            if name not in given and count >= share * len(cells):
                return name
        return None

    def _claim(self, name: int, cells: set[int]) -> None:
        own = self._cells.setdefault(name, set())
        self._cells.move_to_end(name)
        fresh = not own  # what parts from another takes its own places with it
        for cell in sorted(cells):
            if len(own) >= MOST_CELLS:
                break
            if cell not in self._owner or fresh:
                self._give(cell, name)

    def _give(self, cell: int, name: int) -> None:
        before = self._owner.get(cell)
        if before is not None:
            self._cells[before].discard(cell)
        self._owner[cell] = name
        self._cells[name].add(cell)

    def _forget(self) -> None:
        while len(self._cells) > MOST_OBJECTS:
            _, cells = self._cells.popitem(last=False)
            for cell in cells:
                del self._owner[cell]


def _cells(points: NDArray[np.float64]) -> set[int]:
    return set(cell_keys(points).tolist())
