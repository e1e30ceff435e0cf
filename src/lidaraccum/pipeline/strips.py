"""What lies along a mover's way: its middle, which is its own, and walls, which are not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.voxel import thin
from lidaraccum.pipeline.extents import (
    BOX_MARGIN_M,
    Box,
    Motion,
    along_way,
    boxes_of,
    outside_boxes,
)
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.gathering import STANDING_SHARE, accused_of

STRIP_M = 0.5
STRIPS = 1000
STRIP_SPREAD_M = 0.2
"""What lies along a mover's way is told apart in strips so wide and high, fewer than so many; one
obstacle of each cube of the last side is asked about."""

WALL_LOOKS = 10
WALL_SHARE = 0.1
WALL_ACCUSED = 0.02
"""A strip stands that so many looks met when the mover was elsewhere, less than this share as many
went through, and of whose points less than the last share was seen through by more than met it."""


def with_middle(
    picked: Mapping[int, NDArray[np.int64]],
    motion: Motion,
    frames: Sequence[SightedFrame],
    most_growth: float = np.inf,
) -> dict[int, NDArray[np.int64]]:
    """A mover's points and what lies between them in their clusters, unless it is seen to stand.

    A long side that slides along itself is seen through at its ends only, and in some frames at one
    of them: it is as long as all frames together tell. What stands is seen there when the mover is
    elsewhere: so are the walls and the roof of a tunnel, strip by strip, where its ends pass by.
    Nothing is added that has ``most_growth`` times its points.
    """
    filled = dict(picked)
    shown, courses, places = along_way(picked, motion, frames)
    if not shown:
        return filled
    boxes = boxes_of(courses, places)
    between = [
        _between(frame, picked[frame.index], box) for frame, box in zip(shown, boxes, strict=True)
    ]
    if not any(map(len, between)):
        return filled
    strips = _Strips.of(between, shown, boxes)
    for frame, near, own in zip(shown, between, strips.parts, strict=True):
        mine, more = picked[frame.index], near[(strips.through >= strips.met)[own]]
        if len(more) < most_growth * len(mine):
            filled[frame.index] = np.union1d(mine, more)
    return filled


def without_walls(
    picked: Mapping[int, NDArray[np.int64]],
    motion: Motion,
    frames: Sequence[SightedFrame],
) -> dict[int, NDArray[np.int64]]:
    """A mover's points less what lies along its way and stays there when the mover is elsewhere.

    The wall of a tunnel finds partners wherever it goes, as the side of a truck beside it does; but
    the truck's ends are seen through, strip by strip, and of the wall nothing is.
    """
    every = sum(map(len, picked.values()))
    if every == 0 or sum(_doubtful(picked, frames)) < STANDING_SHARE * every:
        return dict(picked)
    shown, courses, places = along_way(picked, motion, frames)
    own = [picked[frame.index] for frame in shown]
    strips = _Strips.of(own, shown, boxes_of(courses, places))
    part = np.concatenate(strips.parts)
    accused = accused_of(own, shown)
    count, blamed = (np.bincount(part, weight, len(strips.met)) for weight in (None, accused))
    stands = (strips.met >= WALL_LOOKS) & (strips.through < WALL_SHARE * strips.met)
    stands &= blamed < WALL_ACCUSED * count
    if stands[part].all():
        return dict(picked)
    kept = [mine[~stands[strip]] for mine, strip in zip(own, strips.parts, strict=True)]
    return {frame.index: mine for frame, mine in zip(shown, kept, strict=True) if len(mine)}


def _doubtful(picked: Mapping[int, NDArray[np.int64]], frames: Sequence[SightedFrame]) -> list[int]:
    """How many obstacles of each frame were met and never seen through."""
    rows = [(frame, picked[frame.index]) for frame in frames if frame.index in picked]
    return [int(((frame.through[own] == 0) & (frame.met[own] > 0)).sum()) for frame, own in rows]


def _between(frame: SightedFrame, picked: NDArray[np.int64], box: Box) -> NDArray[np.int64]:
    """Which obstacles (K,) of the picked ones' clusters are in a box, too."""
    near = _others_of_clusters(frame, picked)
    return near[~outside_boxes([box], frame.world(near), 0.0)[0]]


def _others_of_clusters(frame: SightedFrame, picked: NDArray[np.int64]) -> NDArray[np.int64]:
    """The obstacles of the picked ones' clusters that are not picked themselves."""
    near = frame.in_clusters_of(picked)
    near[picked] = False
    return np.flatnonzero(near)


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
        boxes: Sequence[Box],
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
        spread = [
            thin(frame.points[own], STRIP_SPREAD_M)
            for frame, own in zip(frames, obstacles, strict=True)
        ]
        for frame, few, all_of_it, part in zip(frames, spread, worlds, parts, strict=True):
            world, own = all_of_it[few], part[few]
            for other, outside in zip(
                frames, outside_boxes(boxes, world, BOX_MARGIN_M), strict=True
            ):
                left = np.flatnonzero(outside)
                if other is not frame and len(left):
                    seen = other.view.look(world[left], other.sensor_from_world)
                    through += np.bincount(own[left], seen.through, len(strips)).astype(int)
                    met += np.bincount(own[left], seen.met, len(strips)).astype(int)
        return cls(parts, through, met)


def _strip_keys(aside: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.int64]:
    cells = np.floor(np.stack([aside, heights], axis=1) / STRIP_M).astype(np.int64)
    return np.asarray(cells[:, 0] * STRIPS + cells[:, 1])
