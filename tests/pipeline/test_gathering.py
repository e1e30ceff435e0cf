"""A mover's points are those that go with it: not what stands beside it, not strays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from lidaraccum.pipeline.courses import turned, way
from lidaraccum.pipeline.extents import Motion, length_along, seconds_at_place
from lidaraccum.pipeline.gathering import without_flanks, without_strays
from lidaraccum.pipeline.strips import with_middle, without_walls


@dataclass(frozen=True)
class Dots:
    """As much of a frame as is asked for."""

    points: np.ndarray


@dataclass(frozen=True)
class Passing:
    """A frame of things that pass, and how often their points were met and seen through."""

    index: int
    stamp: float
    points: np.ndarray
    through: np.ndarray
    met: np.ndarray

    def world(self, picked: np.ndarray) -> np.ndarray:
        return self.points[picked]

    @property
    def heights(self) -> np.ndarray:
        return np.asarray(self.points[:, 2])


VELOCITY = np.array([6.0, 2.0, 0.0])


def passing(turn: float, widths: tuple[float, float], shares: tuple[float, float]) -> list[Passing]:
    """400 points up to the first width either side of a course, and 300 beyond the second.

    Shares of each were seen through.
    """
    rng = np.random.default_rng(1)
    frames = []
    for index in range(4):
        stamp = 0.1 * index
        ahead = turned(VELOCITY, turn * stamp)
        ahead = ahead / np.linalg.norm(ahead)
        left = np.array([-ahead[1], ahead[0], 0.0])
        body = rng.uniform(-widths[0], widths[0], 400)
        beyond = rng.uniform(widths[1], widths[1] + 3.0, 300)
        aside = np.concatenate([body, beyond])[:, None]
        along = rng.uniform(-5, 5, (700, 1))
        through = np.concatenate([rng.random(400) < shares[0], rng.random(300) < shares[1]])
        points = way(VELOCITY, turn, stamp) + along * ahead + aside * left
        frames.append(Passing(index, stamp, points, through.astype(int), (~through).astype(int)))
    return frames


def left_of(frames: list[Passing], turn: float) -> list[list[int]]:
    picked = {frame.index: np.arange(len(frame.points)) for frame in frames[:3]}
    going = Motion(VELOCITY, np.zeros(3), 0.0, turn)
    kept = without_flanks(picked, going, frames)  # type: ignore[arg-type]
    assert sorted(kept) == [0, 1, 2]
    return [mine.tolist() for mine in kept.values()]


@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_a_hedge_beside_a_bus_does_not_go_along(turn: float) -> None:
    kept = left_of(passing(turn, (1.25, 4.0), (0.3, 0.08)), turn)
    assert kept == [list(range(400))] * 3


def test_people_side_by_side_all_of_whom_walk_stay_together() -> None:
    kept = left_of(passing(0.0, (1.25, 4.0), (0.5, 0.4)), 0.0)
    assert kept == [list(range(700))] * 3


def test_a_lorry_askew_in_a_bend_stays_whole_and_a_fence_across_does_not() -> None:
    """The way is told straight on. Of both, one half was seen through."""
    lorry, fence = (
        [_seen_halfway(frame, np.deg2rad(degrees)) for frame in passing(0.0, (1, -1), (0, 0))]
        for degrees in (25.0, 90.0)
    )
    assert left_of(lorry, 0.0) == [list(range(700))] * 3
    assert all(len(mine) < 500 for mine in left_of(fence, 0.0))


def _seen_halfway(frame: Passing, angle: float) -> Passing:
    """The frame's things turned on their place, of which the further end was seen through."""
    local = frame.points - way(VELOCITY, 0.0, frame.stamp)
    through = (local @ VELOCITY > 0).astype(int)
    there = np.array([turned(one, angle) for one in local])
    points = there + way(VELOCITY, 0.0, frame.stamp)
    return replace(frame, points=points, through=through, met=1 - through)


def test_a_vehicle_keeps_its_unaccused_side() -> None:
    kept = left_of(passing(0.0, (0.4, 0.4), (0.5, 0.0)), 0.0)
    assert kept == [list(range(700))] * 3


@dataclass(frozen=True)
class Blinkered(Passing):
    """A frame whose points are one cluster, and that saw nothing where others have theirs."""

    sensor_from_world: None = None

    @property
    def view(self) -> Blinkered:
        return self

    def look(self, points: np.ndarray, sensor_from_world: None) -> SimpleNamespace:
        nothing = np.zeros(len(points), dtype=np.bool_)
        return SimpleNamespace(through=nothing, met=nothing)

    def in_clusters_of(self, picked: np.ndarray) -> np.ndarray:
        return np.ones(len(self.points), dtype=np.bool_)


@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_a_bus_is_as_long_as_all_frames_together_tell(turn: float) -> None:
    """Each frame shows through one of its ends alone; the shop window beside it stays."""
    frames = [
        Blinkered(frame.index, frame.stamp, frame.points, frame.through, frame.met)
        for frame in passing(turn, (1.25, 4.0), (0.0, 0.0))[:2]
    ]
    picked = {}
    for frame, end in zip(frames, (-1, 1), strict=True):
        ahead = turned(VELOCITY, turn * frame.stamp)
        along = (frame.points - way(VELOCITY, turn, frame.stamp)) @ (ahead / np.linalg.norm(ahead))
        picked[frame.index] = np.flatnonzero((end * along > 4.0) & (np.arange(700) < 400))
    going = Motion(VELOCITY, np.zeros(3), 0.0, turn)
    filled = with_middle(picked, going, frames)  # type: ignore[arg-type]
    for frame in frames:
        mine = filled[frame.index]
        assert len(mine) > 0.93 * 400  # the outermost is its, where it was picked
        assert (mine < 400).all()


ROOF_M, WALL_M = 4.5, 1.6
"""What is higher stands in `Tunnel`, and what is farther to the left of the way."""


class Tunnel(Blinkered):
    """Its frames meet the roof and the wall wherever they look for them, and see past all else."""

    def look(self, points: np.ndarray, sensor_from_world: None) -> SimpleNamespace:
        stands = (points[:, 2] > ROOF_M) | (points @ LEFT > WALL_M)
        return SimpleNamespace(through=~stands, met=stands)


AHEAD = VELOCITY / np.linalg.norm(VELOCITY)
LEFT = np.array([-AHEAD[1], AHEAD[0], 0.0])


def tunnel() -> list[Tunnel]:
    """1400 points of a bus, of which the ends were seen through, 600 of the roof, 600 of a wall."""
    rng = np.random.default_rng(4)
    frames = []
    for index in range(5):
        along, aside = rng.uniform(-9, 9, 2600), rng.uniform(-1.2, 1.2, 2600)
        high = rng.uniform(0.3, 3.6, 2600)
        high[1400:2000], aside[2000:] = ROOF_M + 0.1, WALL_M + 0.1
        points = along[:, None] * AHEAD + aside[:, None] * LEFT
        points += way(VELOCITY, 0.0, 0.1 * index)  # more and more of roof and wall is in view
        points[:, 2] = high
        through = ((np.abs(along) > 8.5) & (np.arange(2600) < 1400)).astype(int)
        frames.append(Tunnel(index, 0.1 * index, points, through, 1 - through))
    return frames


GOING = Motion(VELOCITY, np.zeros(3), 0.0)


def test_the_roof_of_a_tunnel_above_a_bus_stays_and_does_not_keep_it_from_being_whole() -> None:
    frames, picked = tunnel(), {}
    for frame in frames:  # its ends, and a little of the roof that was taken along
        along = (frame.points - way(VELOCITY, 0.0, frame.stamp)) @ AHEAD
        number = np.arange(2600)
        roof = (number >= 1400) & (number < 2000) & (number % 5 == 0)
        picked[frame.index] = np.flatnonzero((np.abs(along) > 8.0) & ((number < 1400) | roof))
    taken_along = sum(int((mine >= 1400).sum()) for mine in picked.values())
    filled = with_middle(picked, GOING, frames)  # type: ignore[arg-type]
    for mine in filled.values():
        assert (mine < 1400).sum() > 0.99 * 1400
    assert sum(int((mine >= 1400).sum()) for mine in filled.values()) == taken_along
    few = with_middle(picked, GOING, frames, 3.0)  # type: ignore[arg-type]
    assert all(np.array_equal(few[index], mine) for index, mine in picked.items())


def test_a_tunnels_wall_and_roof_that_slide_along_with_a_bus_stay() -> None:
    frames = tunnel()
    picked = {frame.index: np.arange(2600) for frame in frames}
    kept = without_walls(picked, GOING, frames)  # type: ignore[arg-type]
    for mine in kept.values():
        assert (mine < 1400).sum() == 1400
        assert (mine >= 1400).sum() < 60


class Queue(Tunnel):
    """Its frames meet the next vehicle wherever the bus is not."""

    def look(self, points: np.ndarray, sensor_from_world: None) -> SimpleNamespace:
        met = np.ones(len(points), dtype=np.bool_)
        return SimpleNamespace(through=~met, met=met)


def test_what_follows_a_bus_closely_takes_nothing_from_it() -> None:
    """Its place is met when it has gone, but its own ends are seen through at every height."""
    frames = [
        Queue(one.index, one.stamp, one.points[:1400], one.through[:1400], one.met[:1400])
        for one in tunnel()
    ]
    picked = {frame.index: np.arange(1400) for frame in frames}
    kept = without_walls(picked, GOING, frames)  # type: ignore[arg-type]
    assert all(len(mine) == 1400 for mine in kept.values())


def test_a_mover_of_which_nothing_is_left_is_no_trouble() -> None:
    frames = passing(0.0, (1.25, 4.0), (0.3, 0.08))
    course = GOING, frames
    assert without_flanks({}, *course) == {}  # type: ignore[arg-type]
    assert with_middle({}, *course) == {}  # type: ignore[arg-type]
    assert without_walls({}, *course) == {}  # type: ignore[arg-type]


def test_few_points_far_from_the_others_are_not_a_movers() -> None:
    rng = np.random.default_rng(0)
    body, strays = rng.uniform(0, 1, (300, 3)), rng.uniform(4, 4.5, (5, 3))
    frame = Dots(np.concatenate([body, strays]))
    kept = without_strays(frame, np.arange(305))  # type: ignore[arg-type]
    assert kept.tolist() == list(range(300))


@pytest.mark.parametrize("count", [1, 2, 200])
def test_points_that_are_all_apart_stay(count: int) -> None:
    frame = Dots(np.arange(count)[:, None] * np.array([[5.0, 0.0, 0.0]]))
    kept = without_strays(frame, np.arange(count))  # type: ignore[arg-type]
    assert len(kept) == count


def test_a_long_thing_is_longer_at_its_place_than_a_wide_one() -> None:
    bus = np.array([[0.0, 0.0, 0.0], [12.0, 2.5, 3.0]])
    ahead, aside = np.array([6.0, 0.0, 0.0]), np.array([0.0, 6.0, 0.0])
    assert seconds_at_place(length_along(bus, ahead), ahead) == pytest.approx(12.3 / 6)
    assert seconds_at_place(length_along(bus, aside), aside) == pytest.approx(2.8 / 6)
