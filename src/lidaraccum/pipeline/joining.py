"""Movers of one window that are parts of one thing, made one and whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.pipeline.courses import are_alike
from lidaraccum.pipeline.extents import LONGEST_M, is_vehicle_sized, length_along
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.objects import TEMPLATE_POINTS, WindowObject
from lidaraccum.pipeline.suspects import Lead, template_of
from lidaraccum.pipeline.verdict import judge

SAME_GAP_M = 0.8
SAME_SPEED_MPS = 0.8
"""Two movers nearer than this and with velocities as like as this are one."""

LIKE_SPEED_MPS = 2.0
LIKE_SPEED_SHARE = 0.3
NO_WORSE = 0.05
"""So are two whose velocities differ by less than this and this share of the speed, where one of
the motions costs the other's points at most so much more than their own: the long side of a truck
fits many velocities, its ends one."""


WITHIN_SHARE = 0.7
"""A mover with more than this share of its points in a proposer's outline is what that is of."""

_NONE = np.zeros(0, dtype=np.int64)


def complete(
    movers: Sequence[WindowObject],
    leads: Sequence[Lead],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> list[WindowObject]:
    """Movers with all of what a proposer takes for the thing that they are the ends of.

    The long side of a bus slides along itself: whatever motion is tried on all of it explains it
    as well as standing still, and only its ends tell how it goes. What is added goes with them as
    well as it stands, and is no other mover's.
    """
    completed = list(movers)
    for lead in leads:
        inside = [
            place
            for place, one in enumerate(completed)
            if not one.unseen and _share_within(one, lead) > WITHIN_SHARE
        ]
        rest = _rest(lead, completed, frames)
        if inside and rest:
            place = max(inside, key=lambda place: completed[place].size)
            whole = _united(completed[place], replace(completed[place], picked=rest))
            if _is_one(completed[place], rest, whole, frames, settings):
                completed[place] = whole
    return completed


def _share_within(one: WindowObject, lead: Lead) -> float:
    """How much of a mover is what a proposer meant, in the frames that he looked at."""
    own = [(mine, lead.picked[index]) for index, mine in one.picked.items() if index in lead.picked]
    held = sum(int(np.isin(mine, meant).sum()) for mine, meant in own)
    return held / max(sum(len(mine) for mine, _ in own), 1)


def _rest(
    lead: Lead, movers: Sequence[WindowObject], frames: Sequence[SightedFrame]
) -> dict[int, NDArray[np.int64]]:
    """By frame index: what a proposer meant that is no mover's (K,)."""
    rest = {}
    for frame in frames:
        taken = np.concatenate([_NONE, *(one.of(frame) for one in movers)])
        free = np.setdiff1d(lead.picked.get(frame.index, _NONE), taken)
        if len(free):
            rest[frame.index] = free
    return rest


def _is_one(
    part: WindowObject,
    rest: Mapping[int, NDArray[np.int64]],
    whole: WindowObject,
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> bool:
    """Whether the rest goes as its part does as well as it stands, and all is vehicle-sized."""
    own = max(frames, key=lambda frame: len(rest.get(frame.index, _NONE)))
    for frame in frames:
        if len(whole.of(frame)):
            points, ahead = frame.world(whole.of(frame)), part.velocity_at(frame.stamp)
            if not is_vehicle_sized(points, ahead):
                return False
    template = template_of(own, rest[own.index], TEMPLATE_POINTS)
    rivals = np.stack([np.zeros(3), part.velocity_at(own.stamp)])
    cost = judge(template, rivals, frames, settings, np.array([0.0, part.turn])).cost
    return bool(cost[1] < cost[0] + NO_WORSE)


def join_parts(
    objects: Sequence[WindowObject], frames: Sequence[SightedFrame], settings: MotionSettings
) -> list[WindowObject]:
    """Movers that touch and move alike, or as well, made one.

    The largest part's motion stands for all, unless only a smaller one's explains both.
    """
    joined: list[WindowObject] = []
    for part in objects:
        for place, whole in enumerate(joined):
            united = _united_if_one(part, whole, frames, settings)
            if united is not None:
                joined[place] = united
                break
        else:
            joined.append(part)
    return joined


def _united_if_one(
    part: WindowObject,
    whole: WindowObject,
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> WindowObject | None:
    velocities = whole.velocity, part.velocity
    if not are_alike(*velocities, LIKE_SPEED_MPS, LIKE_SPEED_SHARE):
        return None
    if not _touch(part, whole, frames) or _too_long(part, whole, frames):
        return None
    if are_alike(*velocities, SAME_SPEED_MPS, 0.0) or _goes_with(part, whole, frames, settings):
        return _united(whole, part)
    return _united(part, whole) if _goes_with(whole, part, frames, settings) else None


def _goes_with(
    one: WindowObject, other: WindowObject, frames: Sequence[SightedFrame], settings: MotionSettings
) -> bool:
    """Whether another's motion explains a mover's points as well as its own."""
    own = one.fullest(frames)
    template = template_of(own, one.picked[own.index], TEMPLATE_POINTS)
    velocities = [mover.velocity_at(own.stamp) for mover in (one, other)]
    turns = np.array([one.turn, other.turn])
    cost = judge(template, np.stack(velocities), frames, settings, turns).cost
    return bool(cost[1] < cost[0] + NO_WORSE)


def _touch(part: WindowObject, whole: WindowObject, frames: Sequence[SightedFrame]) -> bool:
    """Whether some frame shows them close together, or as ends of one cluster."""
    for frame in frames:
        if frame.index in part.picked and frame.index in whole.picked:
            some, others = part.picked[frame.index], whole.picked[frame.index]
            if frame.in_clusters_of(others)[some].any():
                return True
            if _are_near(frame.points[some], frame.points[others]):
                return True
    return False


def _too_long(part: WindowObject, whole: WindowObject, frames: Sequence[SightedFrame]) -> bool:
    """Whether together they are longer than anything is: one follows the other."""
    both = [(part.of(frame), whole.of(frame), frame) for frame in frames]
    return any(
        length_along(frame.world(np.union1d(some, others)), whole.velocity) > LONGEST_M
        for some, others, frame in both
        if len(some) and len(others)
    )


def _are_near(some: NDArray[np.float64], others: NDArray[np.float64]) -> bool:
    """Whether some of points (N, 3) are nearer than `SAME_GAP_M` to one of others (M, 3)."""
    low = np.maximum(some.min(axis=0), others.min(axis=0)) - SAME_GAP_M
    high = np.minimum(some.max(axis=0), others.max(axis=0)) + SAME_GAP_M
    some = some[((some >= low) & (some <= high)).all(axis=1)]
    others = others[((others >= low) & (others <= high)).all(axis=1)]
    if len(some) == 0 or len(others) == 0:
        return False
    distance, _ = cKDTree(others).query(some, distance_upper_bound=SAME_GAP_M)
    return bool(np.isfinite(distance).any())


def _united(whole: WindowObject, part: WindowObject) -> WindowObject:
    picked = dict(whole.picked)
    for index, rows in part.picked.items():
        picked[index] = np.union1d(picked[index], rows) if index in picked else rows
    return replace(whole, picked=picked)
