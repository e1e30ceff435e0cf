"""Clusters of a frame that other frames saw through: what may have moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.clustering import connected_cells
from lidaraccum.geometry.voxel import thin
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import MotionSettings

SPREAD_M = 0.1
"""A template has no more than one point of each cube so wide."""

MIN_TOP_M = 0.5
"""Nothing that moves on a street is lower than this."""


@dataclass(frozen=True, eq=False)
class Suspect:
    """Points of one frame that may be one mover.

    Attributes:
        frame: Place of the frame in the window.
        picked: (K,) int64: which of the frame's obstacles.
        centre: (3,) their mean in the world, metres.
    """

    frame: int
    picked: NDArray[np.int64]
    centre: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.picked)


@dataclass(frozen=True, eq=False)
class Lead:
    """A proposed mover of a window: worth a look, no more.

    Attributes:
        suspect: Its points in one frame.
        velocities: (H, 3) m/s, world: how its centre may move.
        turns: (H,) radians a second: how it may turn meanwhile.
        trust: 0..1: how sure the proposer is that it moves.
        picked: By frame index in the sequence: all that the proposer takes for its points, which
            of that frame's obstacles (K,).
    """

    suspect: Suspect
    velocities: NDArray[np.float64]
    turns: NDArray[np.float64]
    trust: float
    picked: Mapping[int, NDArray[np.int64]]


def find_suspects(frames: Sequence[SightedFrame], settings: MotionSettings) -> list[Suspect]:
    """All suspects of a window's frames, those with most points first."""
    needed = min(2, len(frames) - 1)
    found = [
        Suspect(place, picked, frame.world(picked).mean(axis=0))
        for place, frame in enumerate(frames)
        for picked in _suspect_groups(frame, needed, settings)
    ]
    return sorted(found, key=lambda suspect: -len(suspect))


def _suspect_groups(
    frame: SightedFrame, needed: int, settings: MotionSettings
) -> list[NDArray[np.int64]]:
    if not len(frame.rows):
        return []
    seed = (frame.through >= needed) & (frame.through > frame.met)
    share = np.bincount(frame.segments, seed) / frame.segment_sizes
    whole = (share >= settings.seed_share)[frame.segments]
    group = np.where(whole, frame.segments, -1)
    # Beside something larger that stands, only what was seen through is suspect.
    part = np.flatnonzero((frame.through > 0) & ~whole)
    group[part] = len(share) + connected_cells(frame.points[part], settings.cell_m)
    picked = np.flatnonzero(group >= 0)
    picked = picked[np.argsort(group[picked], kind="stable")]
    starts = np.flatnonzero(np.diff(group[picked]))
    return [
        rows
        for rows in np.split(picked, starts + 1)
        if np.count_nonzero(seed[rows]) >= settings.seeds
        and len(rows) >= settings.min_points
        and frame.heights[rows].max() > MIN_TOP_M
    ]


@dataclass(frozen=True, eq=False)
class Template:
    """A few points that stand for a cluster while motions are tried on it.

    Attributes:
        world: (P, 3) metres, world, at ``stamp``.
        heights: (P,) metres above the ground.
        stamp: Seconds.
        seconds: (P,) after the stamp, when each was met.
        pivot: (3,) metres, world: the centre of the cluster, about which it turns.
    """

    world: NDArray[np.float64]
    heights: NDArray[np.float64]
    stamp: float
    seconds: NDArray[np.float64]
    pivot: NDArray[np.float64]


def spread_out(frame: SightedFrame, picked: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of the picked obstacles (K,) that stand for all, evenly spread."""
    return picked[thin(frame.points[picked], SPREAD_M)]


def make_template(
    frame: SightedFrame, spread: NDArray[np.int64], count: int, pivot: NDArray[np.float64]
) -> Template:
    """At most ``count`` of obstacles (K,) that are `spread_out`, about a centre (3,), world."""
    if len(spread) > count:
        spread = spread[np.linspace(0, len(spread) - 1, count).astype(np.int64)]
    return replace(whole_template(frame, spread), pivot=pivot)


def template_of(frame: SightedFrame, picked: NDArray[np.int64], count: int) -> Template:
    """At most ``count`` of the picked obstacles (K,), evenly spread, about the centre of all."""
    pivot = frame.world(picked).mean(axis=0)
    return make_template(frame, spread_out(frame, picked), count, pivot)


def whole_template(frame: SightedFrame, picked: NDArray[np.int64]) -> Template:
    """All of the picked obstacles (K,)."""
    world = frame.world(picked)
    return Template(
        world, frame.heights[picked], frame.stamp, frame.seconds[picked], world.mean(axis=0)
    )
