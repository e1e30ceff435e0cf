"""Movers that are one thing: its ends are, two that follow each other are not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.joining import complete, join_parts
from lidaraccum.pipeline.motion_settings import BALANCED
from lidaraccum.pipeline.objects import WindowObject
from lidaraccum.pipeline.sighting import Sighter
from lidaraccum.pipeline.suspects import Lead, Suspect

VELOCITY = np.array([8.0, 1.0, 0.0])


@dataclass(frozen=True)
class OneCluster:
    """A frame in which everything hangs together."""

    points: np.ndarray
    index: int = 0
    stamp: float = 0.0

    def world(self, picked: np.ndarray) -> np.ndarray:
        return self.points[picked]

    def in_clusters_of(self, picked: np.ndarray) -> np.ndarray:
        return np.ones(len(self.points), dtype=np.bool_)


@pytest.mark.parametrize(("apart_m", "count"), [(10.0, 1), (24.0, 2)])
def test_the_ends_of_a_bus_are_one_and_two_cars_in_a_row_are_two(
    apart_m: float, count: int
) -> None:
    rng = np.random.default_rng(0)
    ahead = VELOCITY / np.linalg.norm(VELOCITY)
    end = rng.uniform(-1, 1, (80, 3))
    frame = OneCluster(np.concatenate([end, end + apart_m * ahead]))
    parts = [
        WindowObject({0: np.arange(80) + first}, VELOCITY, np.zeros(3), 0.0, 0.6)
        for first in (0, 80)
    ]
    joined = join_parts(parts, [frame], BALANCED)  # type: ignore[list-item]
    assert len(joined) == count
    assert sum(one.size for one in joined) == 160


BUS_MPS = 16.0
"""The way the x axis goes, 3 m beside a sensor that stands."""


@dataclass(frozen=True)
class Passed:
    """What a window shows of a bus that passes, and of the wall across the street."""

    frames: list[SightedFrame]
    bus: dict[int, np.ndarray]
    wall: dict[int, np.ndarray]

    def end(self) -> WindowObject:
        """The last two metres of the bus, as a mover."""
        picked = {}
        for frame in self.frames:
            along = frame.world(self.bus[frame.index])[:, 0] - BUS_MPS * frame.stamp
            picked[frame.index] = self.bus[frame.index][along < -9.0]
        stamp = self.frames[0].stamp
        centre = self.frames[0].world(picked[self.frames[0].index]).mean(axis=0)
        return WindowObject(picked, np.array([BUS_MPS, 0.0, 0.0]), centre, stamp, 0.5)

    def lead(self, picked: dict[int, np.ndarray]) -> Lead:
        """What a proposer who knows no motion takes for one thing."""
        own = picked[self.frames[0].index]
        suspect = Suspect(0, own, self.frames[0].world(own).mean(axis=0))
        return Lead(suspect, np.zeros((0, 3)), np.zeros(0), 0.9, picked)


@pytest.fixture
def passed(look: Any, new_mover: Any) -> Passed:
    bus = new_mover(low=(-10.0, 3.0, 0.3), size=(18.0, 2.5, 3.0), velocity=(BUS_MPS, 0.0, 0.0))
    street = look([bus], count=4, speed=0.0)
    frames = list(Sighter(BALANCED).all(street.frames))
    mine, wall = {}, {}
    for frame, on in zip(frames, street.on, strict=True):
        x, y, _ = frame.world(np.arange(len(frame.rows))).T
        mine[frame.index] = np.flatnonzero(on[frame.rows] == 1)
        wall[frame.index] = np.flatnonzero((y < -10.5) & (np.abs(x) < 8))
    return Passed(frames, mine, wall)


def sizes(movers: list[WindowObject]) -> list[int]:
    return [one.size for one in movers]


def test_a_bus_of_which_only_an_end_tells_its_way_is_whole(passed: Passed) -> None:
    end, whole = passed.end(), sum(map(len, passed.bus.values()))
    assert 0 < end.size < 0.2 * whole
    (bus,) = complete([end], [passed.lead(passed.bus)], passed.frames, BALANCED)
    assert bus.size == whole
    assert np.array_equal(bus.velocity, end.velocity)


def test_what_stands_is_not_added_whatever_a_proposer_takes_for_one_thing(passed: Passed) -> None:
    end = passed.end()
    both = {index: np.union1d(end.picked[index], wall) for index, wall in passed.wall.items()}
    for meant in (both, passed.wall):
        kept = complete([end], [passed.lead(meant)], passed.frames, BALANCED)
        assert sizes(kept) == [end.size]


def test_what_is_another_movers_stays_its(passed: Passed) -> None:
    end = passed.end()
    other = replace(end, picked={i: mine[::2] for i, mine in passed.bus.items()}, unseen=True)
    free = {i: np.setdiff1d(mine, other.picked[i]) for i, mine in end.picked.items()}
    movers = [replace(end, picked=free), other]
    first, second = complete(movers, [passed.lead(passed.bus)], passed.frames, BALANCED)
    assert second is other
    assert first.size == sum(map(len, passed.bus.values())) - other.size
