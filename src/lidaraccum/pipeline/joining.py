"""Movers of one window that are parts of one thing, made one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.pipeline.courses import are_alike
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.gathering import LONGEST_M, length_along
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.objects import TEMPLATE_POINTS, WindowObject
from lidaraccum.pipeline.suspects import template_of
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
