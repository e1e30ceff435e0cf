"""Whose points are whose: what of each frame of a window is one mover's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.geometry.clustering import connected_cells
from lidaraccum.geometry.voxel import thin
from lidaraccum.pipeline.courses import turned, way
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.landing import Lineup
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.suspects import Suspect, whole_template
from lidaraccum.pipeline.verdict import judge_points

JOIN_M = 0.4
WHOLE_SHARE = 0.5
WHOLE_GROWTH = 2.5
"""A frame's points this near to the moved cluster are its points; so is all of a cluster of which
they are more than this share, unless it has so many times the points."""

GATHERINGS = 3
MOST_GROWTH = 8.0
"""What has so many times the points at one distance is something else: a wall that was touched."""

BOX_MARGIN_M = 0.3
"""So far outside a mover's box, or its strip, nothing is its own."""

WHOLE_QUANTILES = (0.005, 0.995)
"""A mover is at least as long and wide as these of its points, of all frames put together."""

STANDING_SHARE = 0.1
STANDING_MARGIN = 0.1
"""With more than this share of points that were met and never seen through, each is asked whether
standing costs it so much less than moving."""

PASSING_M = 0.3
OUTLASTING_SHARE = 0.5
"""A mover is at a place while it goes its length and this much more. What was there for longer
stands beside it; but where more than this share of it would, its length or speed is wrong."""

LONGEST_M = 25.0
"""Nothing on a road is longer."""

WIDEST_M = 4.0
FLANK_SHARE = 0.5
AS_ACCUSED = 0.98
"""No vehicle is wider. Of what is, and lies beside the strip of this width along its way that was
seen through most, up to the last share, that is something else which was seen through less than
the second share as often: a hedge that the mover passes."""

STRIP_M = 0.5
STRIPS = 1000
"""What lies along a mover's way is told apart in strips so wide and high, fewer than so many."""

WALL_LOOKS = 10
WALL_SHARE = 0.1
WALL_ACCUSED = 0.02
"""A strip stands that so many looks met when the mover was elsewhere, less than this share as many
went through, and of whose points less than the last share was seen through by more than met it."""

SKEW_RAD = np.deg2rad(np.arange(-35, 36, 5))
ENDS = (0.01, 0.99)
"""A vehicle in a bend lies askew to its way, by one of these. Its width lies between these
quantiles of its points."""

STRAY_SHARE = 0.02
STRAY_GAP_M = 1.0
"""Parts of a mover with less than this share of its points, so far from the others, are not its."""


def gather(
    suspect: Suspect,
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turn: float = 0.0,
) -> dict[int, NDArray[np.int64]]:
    """By frame index: the obstacles (K,) of each frame that the moved suspect lies on.

    A suspect may be no more than the end of a truck that was seen through. So what the fullest
    frame shows of it is moved to all others in turn, as long as another becomes the fullest; but
    not what stands or hides there, and then only clusters that are its as a whole are added: a
    wall it touches goes on and on.
    """
    source = frames[suspect.frame]
    gathered = {source.index: suspect.picked}
    for number in range(GATHERINGS):
        there = turned(velocity, turn * (source.stamp - frames[suspect.frame].stamp))
        picked = gathered[source.index]
        if number:
            own = without_standing(
                {source.index: picked}, there, frames, settings, source.stamp, turn
            )
            picked = _accused_parts(own.get(source.index, picked[:0]), source, settings)
        if len(picked) == 0:
            break
        found = _lain_on(source, picked, there, frames, turn, whole_only=number > 0)
        for index, more in found.items():
            known = gathered.get(index)
            gathered[index] = more if known is None else np.union1d(known, more)
        fullest = max(frames, key=lambda frame: len(gathered.get(frame.index, ())))
        if fullest is source:
            break
        source = fullest
    return gathered


def _accused_parts(
    picked: NDArray[np.int64], frame: SightedFrame, settings: MotionSettings
) -> NDArray[np.int64]:
    """The picked obstacles (K,) in parts that others saw through; not what nobody could see."""
    part = connected_cells(frame.points[picked], settings.cell_m)
    share = np.bincount(part, frame.through[picked] > 0) / np.maximum(np.bincount(part), 1)
    return picked[share[part] >= settings.seed_share]


def _lain_on(
    own: SightedFrame,
    picked: NDArray[np.int64],
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    turn: float,
    *,
    whole_only: bool,
) -> dict[int, NDArray[np.int64]]:
    """By frame index: the obstacles (K,) of other frames that some of this one's, moved, lie on."""
    template = whole_template(own, picked)
    lineup = Lineup([frame for frame in frames if frame is not own])
    landed = lineup.land(template, velocity[None], np.array([turn]))[:, :, 0]
    gathered, range_m = {}, _mean_range(own.points[picked])
    for frame, local in zip(lineup.frames, landed.transpose(1, 2, 0), strict=True):
        places = frame.places(local, template.heights)
        found = _points_at(frame, places, whole_only=whole_only)
        nearer = max(1.0, range_m / max(_mean_range(local), 0.1))
        if 0 < len(found) < MOST_GROWTH * len(picked) * nearer**2:
            gathered[frame.index] = found
    return gathered


def _mean_range(points: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(points, axis=1).mean())


def _points_at(
    frame: SightedFrame, places: NDArray[np.float64], *, whole_only: bool
) -> NDArray[np.int64]:
    x, y = frame.level
    low, high = places.min(axis=0) - JOIN_M, places.max(axis=0) + JOIN_M
    about = np.flatnonzero((x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]))
    if len(about) == 0:
        return about
    own = frame.near_places.take(about, axis=0)
    tree = cKDTree(places, balanced_tree=False, compact_nodes=False)
    distance, _ = tree.query(own, distance_upper_bound=JOIN_M)
    close = about[np.isfinite(distance)]
    if len(close) == 0:
        return close
    sizes = frame.segment_sizes
    shares = np.bincount(frame.segments[close], minlength=len(sizes)) / sizes
    whole = (shares > WHOLE_SHARE) & (sizes < WHOLE_GROWTH * len(places))
    keep = whole[frame.segments]
    keep[close[frame.through[close] > 0] if whole_only else close] = True
    return np.flatnonzero(keep)


def without_standing(
    picked: Mapping[int, NDArray[np.int64]],
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    stamp: float,
    turn: float = 0.0,
    margin: float = STANDING_MARGIN,
) -> dict[int, NDArray[np.int64]]:
    """The mover's points less what stands and only touches it (a parked car it passes).

    Its velocity (3,) is that at ``stamp``, its rate of turn in radians a second. What stands costs
    less by a ``margin``, standing; with a negative one, even what costs a little more does.
    """
    kept = {}
    for frame in frames:
        if frame.index not in picked:
            continue
        mine = picked[frame.index]
        doubtful = mine[(frame.through[mine] == 0) & (frame.met[mine] > 0)]
        if len(doubtful) > STANDING_SHARE * len(mine):
            sample = doubtful[thin(frame.points[doubtful], 0.2)]
            template = whole_template(frame, sample)
            rivals = np.stack([np.zeros(3), turned(velocity, turn * (frame.stamp - stamp))])
            cost = judge_points(template, rivals, frames, settings, np.array([0.0, turn]))
            stands = cost[0] + margin < cost[1]
            if stands.any():
                _, nearest = cKDTree(frame.points[sample]).query(frame.points[doubtful])
                mine = np.setdiff1d(mine, doubtful[stands[nearest]])
        if len(mine):
            kept[frame.index] = mine
    return kept


def without_flanks(
    picked: Mapping[int, NDArray[np.int64]],
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    centre: NDArray[np.float64],
    stamp: float,
    turn: float,
) -> dict[int, NDArray[np.int64]]:
    """A mover's points less what is too far aside to be a vehicle's and seldom seen through.

    What grows beside a road has a partner wherever it goes: its costs do not tell.

    Args:
        picked: By frame index: its obstacles (K,).
        velocity: (3,) m/s, world, at ``stamp``.
        frames: The window.
        centre: (3,) metres, world, of some of its points at ``stamp``.
        stamp: Seconds.
        turn: Radians a second.
    """
    shown, _, places = _along(picked, velocity, frames, centre, stamp, turn)
    if not shown:
        return {}
    own = [picked[frame.index] for frame in shown]
    accused = [
        frame.through[mine] > frame.met[mine] for frame, mine in zip(shown, own, strict=True)
    ]
    stays = ~_is_flank(np.concatenate(places), np.concatenate(accused))
    parts = np.split(stays, np.cumsum([len(mine) for mine in own])[:-1])
    kept = [mine[part] for mine, part in zip(own, parts, strict=True)]
    return {frame.index: mine for frame, mine in zip(shown, kept, strict=True) if len(mine)}


def _along(
    picked: Mapping[int, NDArray[np.int64]],
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    centre: NDArray[np.float64],
    stamp: float,
    turn: float,
) -> tuple[list[SightedFrame], list[_Course], list[NDArray[np.float64]]]:
    """The frames that show a mover, where it is in each, and places (K, 2) of its points there."""
    shown = [frame for frame in frames if len(picked.get(frame.index, ()))]
    courses = [_Course.at(frame.stamp - stamp, centre, velocity, turn) for frame in shown]
    places = [
        course.places(frame.world(picked[frame.index]))
        for frame, course in zip(shown, courses, strict=True)
    ]
    return shown, courses, places


def _is_flank(places: NDArray[np.float64], accused: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of points at places (N, 2), metres along and aside, are beside what is accused most."""
    none, aside = np.zeros(len(places), dtype=np.bool_), places[:, 1]
    if np.ptp(aside) <= WIDEST_M or not accused.any() or _width(places) <= WIDEST_M:
        return none
    everywhere, there = np.sort(aside), np.sort(aside[accused])
    starts = np.unique(np.concatenate([there, there - WIDEST_M]))
    held = [
        np.searchsorted(some, starts + WIDEST_M, side="right") - np.searchsorted(some, starts)
        for some in (there, everywhere)
    ]
    enough = held[0] >= AS_ACCUSED * held[0].max()
    start = starts[enough][held[1][enough].argmin()]
    inside = (aside >= start) & (aside <= start + WIDEST_M)
    flank = none
    for side in (aside < start - BOX_MARGIN_M, aside > start + WIDEST_M + BOX_MARGIN_M):
        if side.any() and accused[side].mean() < FLANK_SHARE * accused[inside].mean():
            flank = flank | side
    return flank


def _width(places: NDArray[np.float64]) -> float:
    """How wide, metres, points at places (N, 2) are across, however askew they may lie."""
    across = places @ np.stack([np.sin(SKEW_RAD), np.cos(SKEW_RAD)])
    low, high = np.quantile(across, ENDS, axis=0)
    return float((high - low).min())


def length_along(points: NDArray[np.float64], velocity: NDArray[np.float64]) -> float:
    """Metres from end to end of points (N, 3), world, the way a velocity (3,) goes."""
    return float(np.ptp(points[:, :2] @ velocity[:2]) / np.linalg.norm(velocity))


def width_across(points: NDArray[np.float64], velocity: NDArray[np.float64]) -> float:
    """Metres from side to side of points (N, 3), world, that go with a velocity (3,), or askew."""
    course = _Course.at(0.0, points.mean(axis=0), velocity, 0.0)
    return _width(course.places(points))


def seconds_at_place(length_m: float, velocity: NDArray[np.float64]) -> float:
    """How long a mover of such a length and velocity (3,) is at a place."""
    return (length_m + PASSING_M) / float(np.linalg.norm(velocity))


def without_outlasting(
    frame: SightedFrame, picked: NDArray[np.int64], seconds: float
) -> NDArray[np.int64]:
    """A mover's obstacles (K,) in a frame less what was there longer than it can have been."""
    stands = frame.outlasts(picked, seconds)
    return picked if stands.mean() > OUTLASTING_SHARE else picked[~stands]


def without_strays(frame: SightedFrame, picked: NDArray[np.int64]) -> NDArray[np.int64]:
    """A mover's obstacles (K,) in a frame less the few that lie apart from all others."""
    part = connected_cells(frame.points[picked], STRAY_GAP_M)
    counts = np.bincount(part)
    return picked[counts[part] >= min(STRAY_SHARE * len(picked), counts.max())]


def with_middle(
    picked: Mapping[int, NDArray[np.int64]],
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    centre: NDArray[np.float64],
    stamp: float,
    turn: float,
    most_growth: float = np.inf,
) -> dict[int, NDArray[np.int64]]:
    """A mover's points and what lies between them in their clusters, unless it is seen to stand.

    A long side that slides along itself is seen through at its ends only, and in some frames at one
    of them: it is as long as all frames together tell. What stands is seen there when the mover is
    elsewhere: so are the walls and the roof of a tunnel, strip by strip, where its ends pass by.
    Nothing is added that has ``most_growth`` times its points.
    """
    filled = dict(picked)
    shown, courses, places = _along(picked, velocity, frames, centre, stamp, turn)
    if not shown:
        return filled
    boxes = _boxes(courses, places)
    between = [
        _between(frame, picked[frame.index], box) for frame, box in zip(shown, boxes, strict=True)
    ]
    strips = _Strips.of(between, shown, boxes)
    for frame, near, own in zip(shown, between, strips.parts, strict=True):
        mine, more = picked[frame.index], near[(strips.through >= strips.met)[own]]
        if len(more) < most_growth * len(mine):
            filled[frame.index] = np.union1d(mine, more)
    return filled


def without_walls(
    picked: Mapping[int, NDArray[np.int64]],
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    centre: NDArray[np.float64],
    stamp: float,
    turn: float,
) -> dict[int, NDArray[np.int64]]:
    """A mover's points less what lies along its way and stays there when the mover is elsewhere.

    The wall of a tunnel finds partners wherever it goes, as the side of a truck beside it does; but
    the truck's ends are seen through, strip by strip, and of the wall nothing is.
    """
    shown, courses, places = _along(picked, velocity, frames, centre, stamp, turn)
    if not shown:
        return {}
    own = [picked[frame.index] for frame in shown]
    strips = _Strips.of(own, shown, _boxes(courses, places))
    every = np.concatenate(strips.parts)
    accused = np.concatenate(
        [frame.through[mine] > frame.met[mine] for frame, mine in zip(shown, own, strict=True)]
    )
    count, blamed = (np.bincount(every, weight, len(strips.met)) for weight in (None, accused))
    stands = (strips.met >= WALL_LOOKS) & (strips.through < WALL_SHARE * strips.met)
    stands &= blamed < WALL_ACCUSED * count
    if stands[every].all():
        return dict(picked)
    kept = [mine[~stands[part]] for mine, part in zip(own, strips.parts, strict=True)]
    return {frame.index: mine for frame, mine in zip(shown, kept, strict=True) if len(mine)}


def _boxes(courses: Sequence[_Course], places: Sequence[NDArray[np.float64]]) -> list[_Box]:
    """Where a mover is in each frame, as large as its places (K, 2) of all frames together tell."""
    low, high = np.quantile(np.concatenate(places), WHOLE_QUANTILES, axis=0)
    return [
        _Box(one, np.minimum(low, own.min(axis=0)), np.maximum(high, own.max(axis=0)))
        for one, own in zip(courses, places, strict=True)
    ]


def _between(frame: SightedFrame, picked: NDArray[np.int64], box: _Box) -> NDArray[np.int64]:
    """Which obstacles (K,) of the picked ones' clusters are in a box, too."""
    near = _others_of_clusters(frame, picked)
    return near[box.holds(frame.world(near), 0.0)]


@dataclass(frozen=True, eq=False)
class _Strips:
    """Obstacles of some frames by strips along a mover's way, and what the frames say of them.

    Attributes:
        parts: (K,) int64 of each frame: which strip each of its obstacles is in.
        through: (S,) looks through a strip's obstacles' places by frames in which the mover's box
            is elsewhere.
        met: (S,) such looks that met something.
    """

    parts: list[NDArray[np.int64]]
    through: NDArray[np.int64]
    met: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        obstacles: Sequence[NDArray[np.int64]],
        frames: Sequence[SightedFrame],
        boxes: Sequence[_Box],
    ) -> _Strips:
        """Of obstacles (K,) of each frame, in which the mover is in a box."""
        worlds = [frame.world(own) for frame, own in zip(frames, obstacles, strict=True)]
        keys = [
            _strip_keys(box.course.places(world)[:, 1], frame.heights[own])
            for frame, own, world, box in zip(frames, obstacles, worlds, boxes, strict=True)
        ]
        strips, part = np.unique(np.concatenate(keys), return_inverse=True)
        parts = np.split(part, np.cumsum([len(own) for own in obstacles])[:-1])
        through, met = np.zeros((2, len(strips)), dtype=np.int64)
        for frame, world, own in zip(frames, worlds, parts, strict=True):
            for other, box in zip(frames, boxes, strict=True):
                left = np.flatnonzero(~box.holds(world, BOX_MARGIN_M))
                if other is not frame and len(left):
                    seen = other.view.look(world[left], other.sensor_from_world)
                    through += np.bincount(own[left], seen.through, len(strips)).astype(int)
                    met += np.bincount(own[left], seen.met, len(strips)).astype(int)
        return cls(parts, through, met)


def _strip_keys(aside: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.int64]:
    cells = np.floor(np.stack([aside, heights], axis=1) / STRIP_M).astype(np.int64)
    return np.asarray(cells[:, 0] * STRIPS + cells[:, 1])


def _others_of_clusters(frame: SightedFrame, picked: NDArray[np.int64]) -> NDArray[np.int64]:
    """The obstacles of the picked ones' clusters that are not picked themselves."""
    near = frame.in_clusters_of(picked)
    near[picked] = False
    return np.flatnonzero(near)


@dataclass(frozen=True, eq=False)
class _Course:
    """A mover's level coordinates at one time: along its way and to the left of it.

    Attributes:
        here: (2,) metres, world: where its centre is.
        axes: (2, 2) columns: unit vectors along and to the left.
    """

    here: NDArray[np.float64]
    axes: NDArray[np.float64]

    @classmethod
    def at(
        cls,
        seconds: float,
        centre: NDArray[np.float64],
        velocity: NDArray[np.float64],
        turn: float,
    ) -> _Course:
        """So long after the time of its centre (3,) and velocity (3,), turning so fast."""
        ahead = turned(velocity, turn * seconds)[:2]
        ahead = ahead / np.linalg.norm(ahead)
        axes = np.array([ahead, [-ahead[1], ahead[0]]]).T
        return cls((centre + way(velocity, turn, seconds))[:2], axes)

    def places(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (N, 3), world, along and to the left (N, 2), metres: what goes along stays."""
        return np.asarray((points[:, :2] - self.here) @ self.axes)


@dataclass(frozen=True, eq=False)
class _Box:
    """A level box that goes along with a mover.

    Attributes:
        course: Where the mover is.
        low: (2,) metres along and to the left.
        high: (2,) as well.
    """

    course: _Course
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def holds(self, points: NDArray[np.float64], margin_m: float) -> NDArray[np.bool_]:
        """Which points (N, 3), world, lie in it, grown by a margin."""
        along, across = self.course.places(points).T
        low, high = self.low - margin_m, self.high + margin_m
        inside = (along >= low[0]) & (along <= high[0])
        return inside & (across >= low[1]) & (across <= high[1])
