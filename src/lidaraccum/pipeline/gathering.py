"""Whose points are whose: what of each frame of a window is one mover's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.geometry.clustering import connected_cells
from lidaraccum.geometry.voxel import thin
from lidaraccum.pipeline.courses import turned
from lidaraccum.pipeline.extents import BOX_MARGIN_M, WIDEST_M, Motion, along_way, width
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
"""What has so many times the points at one distance is something else: a wall that was touched. Nor
is so much between a mover's ends."""

STANDING_SHARE = 0.1
STANDING_MARGIN = 0.1
"""With more than this share of points that were met and never seen through, each is asked whether
standing costs it so much less than moving."""

OUTLASTING_SHARE = 0.5
"""What was at a place for longer than a mover is stands beside it; but where more than this share
of it would, its length or speed is wrong."""

FLANK_SHARE = 0.5
AS_ACCUSED = 0.98
"""Of what is wider than a vehicle, and lies beside the strip of a vehicle's width along its way
that was seen through most, up to the last share, that is something else which was seen through less
than the first share as often: a hedge that the mover passes."""

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
    motion: Motion,
    frames: Sequence[SightedFrame],
) -> dict[int, NDArray[np.int64]]:
    """A mover's points less what is too far aside to be a vehicle's and seldom seen through.

    What grows beside a road has a partner wherever it goes: its costs do not tell.

    Args:
        picked: By frame index: its obstacles (K,).
        motion: Where it is and how it goes.
        frames: The window.
    """
    shown, _, places = along_way(picked, motion, frames)
    if not shown:
        return {}
    own = [picked[frame.index] for frame in shown]
    stays = ~_is_flank(np.concatenate(places), accused_of(own, shown))
    parts = np.split(stays, np.cumsum([len(mine) for mine in own])[:-1])
    kept = [mine[part] for mine, part in zip(own, parts, strict=True)]
    return {frame.index: mine for frame, mine in zip(shown, kept, strict=True) if len(mine)}


def accused_of(
    obstacles: Sequence[NDArray[np.int64]], frames: Sequence[SightedFrame]
) -> NDArray[np.bool_]:
    """Which of all obstacles (K,) of each frame, in order, more frames saw through than met."""
    pairs = zip(frames, obstacles, strict=True)
    return np.concatenate([frame.through[own] > frame.met[own] for frame, own in pairs])


def _is_flank(places: NDArray[np.float64], accused: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of points at places (N, 2), metres along and aside, are beside what is accused most."""
    none, aside = np.zeros(len(places), dtype=np.bool_), places[:, 1]
    if np.ptp(aside) <= WIDEST_M or not accused.any() or width(places) <= WIDEST_M:
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
