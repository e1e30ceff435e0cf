"""Which points of a window are looked at closely, and what is read of its maps for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch

from lidaraccum.model.batch import FrameTensors
from lidaraccum.model.kabsch import move
from lidaraccum.model.motion import PointHead, Windows, read

FOREGROUND_GATE = -1.0
"""Points are looked at closely when their pillar's foreground logit is above this (0.27): the
second look takes back what is not."""


def close_pillars(foreground: torch.Tensor) -> torch.Tensor:
    """(V,) bool: which pillars pass the gate, by their logits (V,); worth a closer look."""
    return foreground.detach() > FOREGROUND_GATE


def doubtful_pillars(foreground: torch.Tensor, least_odds: float) -> torch.Tensor:
    """(V,) bool: which pillars do not pass it, but have these odds at least; worth a glance.

    Frames together may show what none shows alone.
    """
    return (foreground.detach() > math.log(least_odds)) & ~close_pillars(foreground)


def points_of(frames: FrameTensors, pillars: torch.Tensor) -> torch.Tensor:
    """(Q,) int64, ascending: the points of some of the pillars (V,) bool."""
    return torch.nonzero(pillars[frames.pillar])[:, 0]


@dataclass(frozen=True, eq=False)
class View:
    """A window's maps, and how its frames lie on them: all that is needed to ask of its points.

    Attributes:
        frames: Of all windows.
        windows: Which frames make which window.
        base: Base features (1, C, S, S) of each frame.
        motion_map: (W, C', S/2, S/2).
        aligned_from_level: (F, 4, 4) to level coordinates of each frame's target.
    """

    frames: FrameTensors
    windows: Windows
    base: Sequence[torch.Tensor]
    motion_map: torch.Tensor
    aligned_from_level: torch.Tensor

    def place(self, point: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Of points (Q,): frame (Q,) int64, ego-aligned place (Q, 3), seconds from the target."""
        frames = self.frames
        frame = frames.point_frame[point]
        aligned = move(self.aligned_from_level[frame], frames.points[point][:, None])[:, 0]
        gaps = self.windows.gaps(frames.stamps)
        return frame, aligned, torch.tensor(gaps, device=point.device).float()[frame]

    def ask(
        self,
        head: PointHead,
        point: torch.Tensor,
        frame: torch.Tensor,
        aligned: torch.Tensor,
        seconds: torch.Tensor,
    ) -> tuple[tuple[torch.Tensor, ...], torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        """What the head says of points (Q,), ascending, whose `place` is known.

        Returns:
            Features of each frame's own (k, D), foreground and dynamic logits (Q,), offsets (Q, 2)
            from the points' ego-aligned places, and the base features (Q, C) that were read.
        """
        frames = self.frames
        xyz, pillar = frames.points[point], frames.pillar[point]
        told = torch.cat(
            [
                xyz[:, :2],
                aligned[:, :2],
                (xyz[:, :2] - frames.pillar_centres()[pillar]) / frames.pillar_m,
                frames.height[point, None],
                seconds[:, None],
            ],
            dim=1,
        )
        counts = torch.bincount(frame, minlength=len(frames)).tolist()
        said = [
            self._ask(head, base, self.motion_map[window : window + 1], own)
            for base, window, own in zip(
                self.base, self.windows.of_frame, torch.split(told, counts), strict=True
            )
        ]
        features, *others = zip(*said, strict=True)
        foreground, dynamic, offset, own_base = map(torch.cat, others)
        return features, foreground, dynamic, offset, own_base

    def _ask(
        self, head: PointHead, base: torch.Tensor, motion_map: torch.Tensor, told: torch.Tensor
    ) -> tuple[torch.Tensor, ...]:
        """Of one frame's points, told (Q, 8): x and y in it, x and y ego-aligned, `place` there."""
        xy, aligned_xy, place = torch.split(told, [2, 2, 4], dim=1)
        half = self.frames.half_extent_m
        own = read(base, xy, half)
        return (*head(read(motion_map, aligned_xy, half), own, place), own)

    def choose(self, head: PointHead, foreground: torch.Tensor, least_odds: float) -> torch.Tensor:
        """The points (Q,) int64, ascending, worth a closer look, by their pillars' logits (V,).

        Those of pillars that pass the gate; and of doubtful ones whose middle point does.
        """
        frames = self.frames
        passed = close_pillars(foreground)
        doubtful = torch.nonzero(doubtful_pillars(foreground, least_odds))[:, 0]
        count = torch.bincount(frames.pillar, minlength=len(foreground))
        middle = (count.cumsum(0) - count + count // 2)[doubtful]
        _, glanced, *_ = self.ask(head, middle, *self.place(middle))
        passed[doubtful] = close_pillars(glanced)
        return points_of(frames, passed)


def speakers_of(pillar: torch.Tensor, every: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Which of points (Q,), by their pillars, are read, (K,), and which of those speaks for each.

    Every so many of each pillar from its first on; both int64, ascending.
    """
    count = torch.arange(len(pillar), device=pillar.device)
    if every == 1:
        return count, count
    begins = torch.ones_like(pillar, dtype=torch.bool)
    begins[1:] = pillar[1:] != pillar[:-1]
    first = torch.cummax(torch.where(begins, count, 0), dim=0).values
    reads = (count - first) % every == 0
    return torch.nonzero(reads)[:, 0], torch.cumsum(reads, dim=0) - 1
