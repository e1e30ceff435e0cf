"""Which points of a window are looked at closely, and what is read of its maps for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import nn

from lidaraccum.model.batch import FrameTensors
from lidaraccum.model.kabsch import move
from lidaraccum.model.motion import PointHead, Windows, read

FOREGROUND_GATE = -1.0
"""Points are looked at closely when their pillar's foreground logit is above this (0.27): the
second look takes back what is not."""
BESIDE_M = 2.0
"""So far from what moves its own parts are looked for."""


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

    def choose(
        self, head: PointHead, foreground: torch.Tensor, glance_odds: float, beside_odds: float
    ) -> torch.Tensor:
        """The points (Q,) int64, ascending, worth a closer look, by their pillars' logits (V,).

        Those of pillars that pass the gate; of doubtful ones whose middle point does; and of such,
        within `BESIDE_M` of what moves, whose middle point moves: an object that is found is found
        whole.
        """
        count = torch.bincount(self.frames.pillar, minlength=len(foreground))
        middle = count.cumsum(0) - count + count // 2
        passed = close_pillars(foreground)
        doubtful = torch.nonzero(doubtful_pillars(foreground, glance_odds))[:, 0]
        glanced, _ = self._glance(head, middle[doubtful])
        passed[doubtful] = close_pillars(glanced)
        doubtful = doubtful_pillars(foreground, beside_odds) & ~passed
        if doubtful.any():
            asked = torch.nonzero(passed)[:, 0]
            doubtful &= self._beside(asked[_moves(*self._glance(head, middle[asked]))])
            beside = torch.nonzero(doubtful)[:, 0]
            passed[beside] = _moves(*self._glance(head, middle[beside]))
        return points_of(self.frames, passed)

    def _glance(self, head: PointHead, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Foreground and dynamic logits of points (K,) int64, ascending."""
        _, foreground, dynamic, *_ = self.ask(head, points, *self.place(points))
        return foreground, dynamic

    def _beside(self, pillars: torch.Tensor) -> torch.Tensor:
        """(V,) bool: pillars within `BESIDE_M`, in x and in y, of some (K,) of their own frame."""
        frames = self.frames
        size = frames.cells
        near = torch.zeros(len(frames) * size * size, device=pillars.device)
        near[frames.pillar_place[pillars]] = 1.0
        reach = math.ceil(BESIDE_M / frames.pillar_m)
        near = near.view(-1, 1, size, size)
        for window, pad in (((2 * reach + 1, 1), (reach, 0)), ((1, 2 * reach + 1), (0, reach))):
            near = nn.functional.max_pool2d(near, window, stride=1, padding=pad)
        return near.view(-1)[frames.pillar_place] > 0.0


def _moves(foreground: torch.Tensor, dynamic: torch.Tensor) -> torch.Tensor:
    return (foreground > 0.0) & (dynamic > 0.0)


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
