"""A place keeps its name; what moves takes its name along; memory is bounded."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.pipeline import still_objects
from lidaraccum.pipeline.object_ids import ObjectIds
from lidaraccum.pipeline.still_objects import StillObjects


def car(x: float, y: float, length: float = 4.0) -> np.ndarray:
    """(K, 2) points of a car's outline, its corner at x and y."""
    along, across = np.meshgrid(np.arange(0, length, 0.1), np.arange(0, 1.8, 0.1))
    return np.column_stack([along.ravel() + x, across.ravel() + y])


@pytest.fixture
def still() -> StillObjects:
    return StillObjects(ObjectIds())


def test_what_stands_keeps_its_name_whatever_comes_first(still: StillObjects) -> None:
    first = still.name([car(0, 0), car(10, 0)])
    assert sorted(first) == [1, 2]
    assert still.name([car(10.1, 0.1), car(30, 5), car(0.1, 0)]) == [first[1], 3, first[0]]


def test_a_part_of_it_is_it(still: StillObjects) -> None:
    whole = still.name([car(0, 0)])
    assert still.name([car(2.5, 0.2, length=1.0)]) == whole


def test_it_is_known_again_after_a_long_time(still: StillObjects) -> None:
    first = still.name([car(0, 0)])
    for step in range(50):
        still.name([car(10.0 * step + 10, 4)])
    assert still.name([car(0, 0)]) == first


def test_two_clusters_of_a_frame_never_share_a_name(still: StillObjects) -> None:
    still.name([np.concatenate([car(0, 0), car(5, 0)])])
    parted = still.name([car(0, 0), car(5, 0)])
    assert len(set(parted)) == 2
    assert still.name([car(0, 0), car(5, 0)]) == parted


def test_a_mover_takes_its_name_to_where_it_stops(still: StillObjects) -> None:
    ids = ObjectIds()
    still = StillObjects(ids)
    mover = ids.new()
    for step in range(5):
        still.follow(mover, car(2.0 * step, 0))
    assert still.name([car(8.1, 0)]) == [mover]
    assert still.name([car(0, 0)]) != [mover]


def test_a_wall_that_a_mover_passes_does_not_go_along(still: StillObjects) -> None:
    ids = ObjectIds()
    still = StillObjects(ids)
    mover = ids.new()
    still.follow(mover, car(3, 0))
    wall = np.concatenate([car(-8, 0, length=15.0), car(-8, 1.8, length=15.0)])
    assert still.name([wall], moving={mover}) != [mover]
    still.follow(mover, car(3, 0))
    assert still.name([car(3.2, 0)], moving={mover}) == [mover]  # what is left of itself does


def test_the_oldest_are_forgotten(monkeypatch: pytest.MonkeyPatch, still: StillObjects) -> None:
    monkeypatch.setattr(still_objects, "MOST_OBJECTS", 3)
    first = still.name([car(0, 0)])
    for step in range(4):
        still.name([car(10.0 * step + 10, 0)])
    assert len(still._cells) == 3
    assert len(still._owner) == sum(map(len, still._cells.values()))
    assert still.name([car(0, 0)]) != first
