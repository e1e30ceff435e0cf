"""Movers of overlapping windows linked into one object each, through the whole sequence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid
from lidaraccum.pipeline.courses import are_alike, turned
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.joining import LIKE_SPEED_MPS, LIKE_SPEED_SHARE
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.object_ids import ObjectIds
from lidaraccum.pipeline.objects import Expectation, WindowObject
from lidaraccum.pipeline.shape import ObjectShape

OVERLAP = 0.3
"""Share of the smaller's points that two windows' movers must share to be one."""

REACH_M = 1.5
REACH_S = 1.0
"""A mover this near to where a lost one must be by now, and lost no longer than this, is it."""

FAR_M = 15.0
"""Centres farther apart are not looked at: no mover is so long."""


@dataclass
class Track:
    """One mover through the sequence, as far as windows have come.

    Attributes:
        instance: Its id, positive.
        velocity: (3,) m/s, world, in the latest window.
        centre: (3,) metres, world, at ``stamp``.
        stamp: Seconds.
        windows: Windows that agree on its motion.
        margin: The best margin over standing still.
        picked: By frame index: its obstacles (K,) in frames that are not finished.
        velocities: By frame index: m/s, world, in frames that are not finished.
        turns: By frame index: radians a second, in frames that are not finished.
        shape: All it has shown, in its own coordinates; None before its first finished frame.
        world_from_object: (4, 4) in its last finished frame.
        last_index: That frame.
        last_stamp: Its stamp.
        points: Points it had in it.
    """

    instance: int
    velocity: NDArray[np.float64]
    centre: NDArray[np.float64]
    stamp: float
    windows: int = 0
    margin: float = 0.0
    picked: dict[int, NDArray[np.int64]] = field(default_factory=dict)
    velocities: dict[int, NDArray[np.float64]] = field(default_factory=dict)
    turns: dict[int, float] = field(default_factory=dict)
    shape: ObjectShape | None = None
    world_from_object: rigid.Pose = field(default_factory=lambda: np.eye(4))
    last_index: int = -1
    last_stamp: float = -np.inf
    points: int = 0
    most_points: int = 0

    @property
    def expectation(self) -> Expectation:
        """Where it was last and how it moved."""
        return Expectation(self.centre, self.velocity, self.stamp)

    def agrees(self, velocity: NDArray[np.float64]) -> bool:
        """Whether a velocity (3,) can be this mover's in the next window."""
        return are_alike(self.velocity, velocity, LIKE_SPEED_MPS, LIKE_SPEED_SHARE)

    def take(self, found: WindowObject, frames: Sequence[SightedFrame]) -> None:
        """Go on with what the latest window says."""
        self.windows += 1
        self.margin = max(self.margin, found.margin)
        self.velocity, self.centre, self.stamp = found.velocity, found.centre, found.stamp
        for frame in frames:
            picked = found.picked.get(frame.index)
            if picked is None:
                continue
            known = self.picked.get(frame.index)
            self.picked[frame.index] = picked if known is None else np.union1d(known, picked)
            angle = found.turn * (frame.stamp - found.stamp)
            self.velocities[frame.index] = turned(found.velocity, angle)
            self.turns[frame.index] = found.turn

    def forget(self, index: int) -> None:
        """Drop what is kept for a frame that is finished."""
        self.picked.pop(index, None)
        self.velocities.pop(index, None)
        self.turns.pop(index, None)


class Association:
    """The movers known so far; each window's movers continue them or begin new ones."""

    def __init__(self, settings: MotionSettings, ids: ObjectIds | None = None) -> None:
        self._settings = settings
        self._ids = ids or ObjectIds()
        self._windows = 0
        self.tracks: list[Track] = []

    def link(self, objects: Sequence[WindowObject], frames: Sequence[SightedFrame]) -> None:
        """Take in the movers of the next window, oldest frame first."""
        self._windows += 1
        start = frames[0].stamp
        self.tracks = [
            track for track in self.tracks if max(track.stamp, track.last_stamp) >= start - REACH_S
        ]
        known = list(self.tracks)
        for found in objects:
            track = _same(found, known)
            if track is None:
                track = Track(self._ids.new(), found.velocity, found.centre, found.stamp)
                self.tracks.append(track)
            track.take(found, frames)

    def is_sure(self, track: Track) -> bool:
        """Whether a track may be called moving: two windows agree, or one is beyond doubt."""
        enough = min(2, self._windows)
        return track.windows >= enough or track.margin > self._settings.sure_margin


def _same(found: WindowObject, tracks: Sequence[Track]) -> Track | None:
    best, most = None, OVERLAP
    for track in tracks:
        if np.linalg.norm(track.expectation.centre_at(found.stamp) - found.centre) > FAR_M:
            continue
        shares = [
            len(np.intersect1d(picked, track.picked[index], assume_unique=True))
            / min(len(picked), len(track.picked[index]))
            for index, picked in found.picked.items()
            if index in track.picked
        ]
        share = max(shares, default=0.0)
        if share > most and track.agrees(found.velocity):
            best, most = track, share
    return best or _nearest_lost(found, tracks)


def _nearest_lost(found: WindowObject, tracks: Sequence[Track]) -> Track | None:
    best, nearest = None, REACH_M
    for track in tracks:
        if track.picked.keys() & found.picked.keys() or not track.agrees(found.velocity):
            continue
        away = float(np.linalg.norm((track.expectation.centre_at(found.stamp) - found.centre)[:2]))
        if away < nearest:
            best, nearest = track, away
    return best
