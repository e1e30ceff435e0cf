"""Where one can drive: paths with a length, roads with kerbs, and the network they form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
FAR_M = 50.0
"""Beyond this it does not matter how far a road is."""


@dataclass(frozen=True, eq=False)
class Path:
    """A line one can drive along.

    Attributes:
        points: (K, 2) float64 world x, y in metres, about a metre apart, in driving order.
    """

    points: Array

    @cached_property
    def arc(self) -> Array:
        """(K,) metres along the path."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def headings(self) -> Array:
        """(K,) radians, unwrapped."""
        ahead = np.gradient(self.points, axis=0)
        return np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))

    @property
    def length(self) -> float:
        """Metres from end to end."""
        return float(self.arc[-1])

    def at(self, along: Array | float, lateral: Array | float = 0.0) -> tuple[Array, Array]:
        """Place (..., 2) and heading (...) at metres ``along`` and ``lateral`` to the left.

        Beyond its ends the path goes straight on.
        """
        along = np.asarray(along, dtype=np.float64)
        inside = np.clip(along, 0.0, self.length)
        heading = np.interp(inside, self.arc, self.headings)
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        left = np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)
        place = np.stack(
            [np.interp(inside, self.arc, self.points[:, axis]) for axis in (0, 1)], axis=-1
        )
        beyond = (along - inside)[..., None] * ahead
        return place + beyond + np.asarray(lateral)[..., None] * left, heading

    def beside(self, lateral: float) -> Path:
        """The path ``lateral`` metres to the left."""
        return Path(self.at(self.arc, np.full(len(self.arc), lateral))[0])

    @property
    def reversed(self) -> Path:
        """The path the other way."""
        return Path(self.points[::-1].copy())

    def part(self, start: float, end: float) -> Path:
        """The piece between two arc lengths, metres."""
        count = max(int(abs(end - start)) + 1, 2)
        return Path(self.at(np.linspace(start, end, count))[0])

    def nearest(self, place: Array) -> float:
        """Arc length, metres, of the point nearest to a place (2,)."""
        return float(self.arc[np.argmin(np.linalg.norm(self.points - place, axis=1))])


def straight(start: Array, heading: float, length: float) -> Path:
    """A straight path of so many metres."""
    along = np.linspace(0, length, max(int(length) + 1, 2))
    return Path(start + along[:, None] * [np.cos(heading), np.sin(heading)])


def winding(start: Array, heading: float, curvature: Array) -> Path:
    """A path of one metre steps with a curvature (K,) in 1/m at each."""
    headings = heading + np.concatenate([[0.0], np.cumsum(curvature)])
    middle = 0.5 * (headings[1:] + headings[:-1])
    steps = np.stack([np.cos(middle), np.sin(middle)], axis=1)
    return Path(np.concatenate([start[None], start + np.cumsum(steps, axis=0)]))


def circle(centre: Array, radius: float, start: float, turn: float) -> Path:
    """An arc of ``turn`` radians (negative: clockwise) from the angle ``start``."""
    angle = start + np.linspace(0, turn, max(int(abs(turn) * radius) + 1, 8))
    return Path(centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def joined(pieces: list[Path]) -> Path:
    """One smooth path through the pieces; gaps are bridged by cubic curves."""
    points = [pieces[0].points]
    for before, after in pairwise(pieces):
        start, end = before.points[-1], after.points[0]
        gap = float(np.linalg.norm(end - start))
        if gap > 1.5:
            points.append(_bridge(before, after, gap))
        points.append(after.points[1:] if gap < 1e-6 else after.points)
    return Path(np.concatenate(points))


def _bridge(before: Path, after: Path, gap: float) -> Array:
    start, end = before.points[-1], after.points[0]
    out, into = before.headings[-1], after.headings[0]
    first = start + 0.4 * gap * np.array([np.cos(out), np.sin(out)])
    second = end - 0.4 * gap * np.array([np.cos(into), np.sin(into)])
    t = np.linspace(0, 1, max(int(gap * 1.2), 4) + 1)[1:-1, None]
    return (
        (1 - t) ** 3 * start
        + 3 * (1 - t) ** 2 * t * first
        + 3 * (1 - t) * t**2 * second
        + t**3 * end
    )


@dataclass(frozen=True, eq=False)
class Road:
    """A carriageway between kerbs.

    Attributes:
        centre: Its middle line.
        lanes: Lanes each way.
        lane_m: Width of a lane.
        parking_m: Width of the parking strip on each side, 0 for none.
        walk_m: Width of the pavement on each side, 0 for none.
        speed_mps: What is driven there.
    """

    centre: Path
    lanes: int = 1
    lane_m: float = 3.3
    parking_m: float = 0.0
    walk_m: float = 2.5
    speed_mps: float = 12.0

    @property
    def drive_m(self) -> float:
        """Half the width that is driven on."""
        return self.lanes * self.lane_m

    @property
    def half_m(self) -> float:
        """From the middle to the kerb."""
        return self.drive_m + self.parking_m

    @cached_property
    def tree(self) -> cKDTree:
        """Of the middle line's points."""
        return cKDTree(self.centre.points)

    def lane(self, index: int, hand: int) -> Path:
        """Lane ``index`` from the middle, forward; ``hand`` +1 drives on the right."""
        return self.centre.beside(-hand * (index + 0.5) * self.lane_m)

    def oncoming(self, index: int, hand: int) -> Path:
        """Lane ``index`` from the middle, the other way."""
        return self.centre.beside(hand * (index + 0.5) * self.lane_m).reversed


@dataclass(frozen=True, eq=False)
class Lane:
    """Something to drive along, and how fast."""

    path: Path
    speed_mps: float


@dataclass(frozen=True, eq=False)
class Network:
    """Roads, the lanes on them and the ego's own way.

    Attributes:
        kind: The scene's kind.
        roads: All roads; buildings and kerbs line them.
        lanes: What others drive along; may cross each other.
        ego: The ego's path; it starts ``ego_start`` metres along it.
        ego_start: Metres.
        hand: +1 when traffic keeps right, -1 left.
        squares: (M, 3) x, y, radius in metres of open paved places.
        islands: (M, 3) x, y, radius of a roundabout's middle.
        ego_speed_limit: What bends allow, metres a second.
    """

    kind: str
    roads: tuple[Road, ...]
    lanes: tuple[Lane, ...]
    ego: Path
    ego_start: float
    hand: int
    squares: Array
    islands: Array
    ego_speed_limit: float = 40.0

    def edge_distances(self, places: Array) -> tuple[Array, Array]:
        """How far places (N, 2) lie from the road, metres, at most about ``FAR_M``.

        Returns:
            (N,) from the nearest kerb, negative on a carriageway; and (N,) from the outer edge of
            the nearest pavement, negative inside.
        """
        kerb = np.full(len(places), FAR_M)
        walk = kerb.copy()
        for road in self.roads:
            gap = road.tree.query(places, distance_upper_bound=FAR_M)[0] - road.half_m
            np.minimum(kerb, gap, out=kerb)
            np.minimum(walk, gap - road.walk_m, out=walk)
        return kerb, walk

    def in_square(self, places: Array) -> NDArray[np.bool_]:
        """Whether places (N, 2) lie in an open square."""
        if not len(self.squares):
            return np.zeros(len(places), dtype=np.bool_)
        gap = np.linalg.norm(places[:, None] - self.squares[None, :, :2], axis=2)
        return np.any(gap < self.squares[:, 2], axis=1)
