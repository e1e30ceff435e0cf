"""Ego-motion: matched background pillars of two frames, and the rigid motion between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

import torch
from torch import nn

from lidaraccum.model.batch import FrameTensors
from lidaraccum.model.convolution import Convolution
from lidaraccum.model.kabsch import exactly, fit_rigid, invert, move
from lidaraccum.model.levelling import levelled
from lidaraccum.model.partners import drawn_to, spread
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.sinkhorn import SoftMatches, sinkhorn

SHARPEST = 0.02
_LEAST_REACH_M = 1.0
STANDING_M = 0.3
"""Pillars whose points lie this high above ground, on average, stand out of it."""
LOW_M = 0.2
"""Pillars whose points lie no higher, nor deeper, are the ground's."""


_Kind = TypeVar("_Kind", bound="_Rows")


@dataclass(frozen=True, eq=False)
class _Rows:
    """Tensors, each with a row for every item."""

    def pick(self: _Kind, index: torch.Tensor) -> _Kind:
        """Items (K,) int64, in that order."""
        return type(self)(*(getattr(self, item.name)[index] for item in fields(self)))

    @classmethod
    def stack(cls: type[_Kind], parts: Sequence[_Kind]) -> _Kind:
        """Several put one after another."""
        columns = ([getattr(part, item.name) for part in parts] for item in fields(cls))
        return cls(*map(torch.cat, columns))


@dataclass(frozen=True, eq=False)
class EgoPillars(_Rows):
    """The N background pillars that speak for each of F frames, and G of its ground.

    Attributes:
        position: (F, N, 3) float32, metres: mean of the pillar's points, level coordinates.
        feature: (F, N, E) unit vectors.
        valid: (F, N) bool: False where the frame has too little background.
        ground: (F, G, 3) metres: means of the ground's pillars, level coordinates.
        on_ground: (F, G) bool: False where the frame has too little ground.
        level_from_sensor: (F, 4, 4).
    """

    position: torch.Tensor
    feature: torch.Tensor
    valid: torch.Tensor
    ground: torch.Tensor
    on_ground: torch.Tensor
    level_from_sensor: torch.Tensor

    @classmethod
    def none(cls, level_from_sensor: torch.Tensor, channels: int) -> EgoPillars:
        """No pillars, of F frames (F, 4, 4) that nobody is to match."""
        shape = (len(level_from_sensor), 0)
        position = level_from_sensor.new_zeros(*shape, 3)
        feature = level_from_sensor.new_zeros(*shape, channels)
        nowhere = position[..., 0].bool()
        return cls(position, feature, nowhere, position, nowhere, level_from_sensor)


@dataclass(frozen=True, eq=False)
class EgoMatch(_Rows):
    """Proposed motions between B pairs of frames.

    Attributes:
        target_from_source: (B, 4, 4) float32, sensor coordinates.
        level_target_from_source: (B, 4, 4) the same between level coordinates.
        source: (B, N, 3) the source pillars, level coordinates, metres.
        row_mass: (B, N) 0..1: how far a source pillar found partners; 0 where it is not valid.
        column_mass: (B, N) 0..1, of target pillars.
        source_valid: (B, N) bool.
        target_valid: (B, N) bool.
        rounds: (B, R, 4, 4) the motion between level coordinates after each round of matching, the
            last one's being the answer; first the motion begun with, where one was given.
    """

    target_from_source: torch.Tensor
    level_target_from_source: torch.Tensor
    source: torch.Tensor
    row_mass: torch.Tensor
    column_mass: torch.Tensor
    source_valid: torch.Tensor
    target_valid: torch.Tensor
    rounds: torch.Tensor


class EgoHead(nn.Module):
    """Features of a few pillars: two 3 x 3 convolutions, run on those pillars' 5 x 5 patches only.

    The paper runs them over the whole map and reads 1024 of 65 536 cells. No batch norm, so that a
    frame's features do not depend on its company.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        channels = settings.ego_channels
        self.inner = Convolution(settings.base_widths[0], channels, 3)
        self.outer = Convolution(channels, channels, 3)

    def forward(self, base: torch.Tensor, frame: torch.Tensor, cell: torch.Tensor) -> torch.Tensor:
        """Unit vectors (K, E) at K cells of base maps (F, C, S, S); frame and cell are (K,)."""
        patches = _patches(base, frame, cell)  # (K, C, 5, 5)
        features = self.outer(torch.relu(self.inner(patches)))[:, :, 0, 0]
        return nn.functional.normalize(features.float(), dim=1)


def _patches(base: torch.Tensor, frame: torch.Tensor, cell: torch.Tensor) -> torch.Tensor:
    size = base.shape[2]
    step = torch.arange(-2, 3, device=base.device)
    x = (cell // size)[:, None, None] + step[:, None]  # (K, 5, 1)
    y = (cell % size)[:, None, None] + step  # (K, 1, 5)
    inside = (x >= 0) & (x < size) & (y >= 0) & (y < size)
    flat = frame[:, None, None] * size * size + x.clamp(0, size - 1) * size + y.clamp(0, size - 1)
    rows = base.permute(0, 2, 3, 1).reshape(-1, base.shape[1])
    read = rows.index_select(0, flat.reshape(-1)).view(*flat.shape, -1)
    return (read * inside[..., None]).permute(0, 3, 1, 2)


def choose_background(
    frames: FrameTensors, foreground: torch.Tensor, count: int, seed: int, standing_odds: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw pillars of each frame, background first: indices and validity (F, count).

    Args:
        frames: F frames with V pillars.
        foreground: (V,) logits; above 0 is not background.
        count: Pillars a frame.
        seed: Another one, another choice. The choice depends on the frame's own points and on
            nothing else: not on their order, nor on the frame's company.
        standing_odds: How much rather than others pillars are drawn that stand out of the ground.
    """
    owner = frames.pillar_frame
    points = torch.tensor(frames.point_counts, device=owner.device)
    key = _hash(frames.pillar_cell + 65536 * 7 * points[owner] + 1_000_003 * seed)
    odds = torch.where(frames.pillar_height > STANDING_M, standing_odds, 1.0)
    key = key ** (1.0 / odds)  # drawn by odds without putting back (Efraimidis and Spirakis, 2006)
    return _first(frames, 1.0 - key, foreground <= 0, count)


def choose_ground(
    frames: FrameTensors, foreground: torch.Tensor, count: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw pillars of each frame's ground by lot: indices and validity (F, count).

    Args:
        frames: F frames with V pillars.
        foreground: (V,) logits; above 0 is no ground.
        count: Pillars a frame.
    """
    low = (frames.pillar_height.abs() < LOW_M) & (foreground <= 0)
    return _first(frames, _hash(frames.pillar_cell), low, count)


def _first(
    frames: FrameTensors, key: torch.Tensor, suits: torch.Tensor, count: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Of each frame's pillars the first by key (V,), 0..1: indices, and whether they suit."""
    owner = frames.pillar_frame
    order = torch.argsort(key + ~suits + 2.0 * owner)  # what suits below 1, the rest above
    starts = torch.tensor((0, *frames.pillar_counts[:-1]), device=owner.device).cumsum(0)
    rank = torch.arange(len(order), device=owner.device) - starts[owner]
    kept = order[rank < count]
    index = torch.zeros(len(frames), count, dtype=torch.int64, device=owner.device)
    valid = torch.zeros(len(frames), count, dtype=torch.bool, device=owner.device)
    slot = owner[rank < count] * count + rank[rank < count]
    index.view(-1)[slot] = kept
    valid.view(-1)[slot] = suits[kept]
    return index, valid


def _hash(number: torch.Tensor) -> torch.Tensor:
    """Numbers (V,) float64 in 0..1 that look drawn by lot, of integers (V,)."""
    mask = 0xFFFFFFFF
    mixed = (number * 0x9E3779B1) & mask
    for factor in (0x2C1B3C6D, 0x297A2D39):
        mixed = ((mixed ^ (mixed >> 15)) * factor) & mask
    return (mixed ^ (mixed >> 15)).double() / (mask + 1)


class Matcher(nn.Module):
    """Soft matches between the background pillars of two frames, and the motion they say.

    Ours: matched again, a few times, about where the motion so far puts the pillars, within less
    and less reach. Few of the pillars drawn in one frame are drawn in the other too; at first a
    pillar may have its partner far away, in the end only next to it.

    Source: the paper, section 3.2 and supplement; the affinity's form from METHOD.md; matching in
    rounds as RPM-Net (Yew and Lee, CVPR 2020).

    Also ours: how high the source lies, and how level, is what the ground says. Pillars that stand
    out of it tell the way, but the mean height of a wall's points is the beams' that met it.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        rounds = 1 + len(settings.rematch_m)
        self.offset = nn.Parameter(torch.full((rounds,), settings.slack_start))
        self.scale = nn.Parameter(torch.full((rounds,), settings.scale_start))
        self.rematch_m = settings.rematch_m
        self.finer_m = settings.finer_m
        self.sinkhorn_rounds = settings.sinkhorn_rounds
        self.fastest_mps = settings.fastest_mps

    def forward(
        self,
        source: EgoPillars,
        target: EgoPillars,
        gap_s: torch.Tensor,
        start: torch.Tensor | None = None,
    ) -> EgoMatch:
        """Motions between B pairs of frames; float32 throughout.

        Args:
            source: B frames.
            target: B frames.
            gap_s: (B,) seconds between them.
            start: (B, 4, 4) motions between level coordinates, good to the first of ``rematch_m``:
                what is already near them is matched, and the first round is spared.
        """
        with exactly(source.position):
            impossible = ~(source.valid[:, :, None] & target.valid[:, None, :])
            if start is None:
                reach = (self.fastest_mps * gap_s.abs()).clamp_min(_LEAST_REACH_M)
                apart = torch.cdist(source.position[..., :2], target.position[..., :2])
                near = torch.zeros_like(apart).masked_fill_(
                    impossible | (apart > reach[:, None, None]), -torch.inf
                )
                matches = self._match(source, target, near, 0)
                partner, row_mass = _partners(matches, target)
                motion = fit_rigid(source.position, partner, row_mass)
            else:
                motion = start
            rounds = [motion]
            last = len(self.rematch_m)
            finer = () if self.training else self.finer_m
            for number, near_m in enumerate((*self.rematch_m, *finer), start=1):
                placed = move(motion.detach(), source.position)
                apart = torch.cdist(placed, target.position)
                # A normal distribution, cut off at two sigmas.
                near = (-2.0 * (apart / near_m) ** 2).masked_fill_(
                    impossible | (apart > near_m), -torch.inf
                )
                matches = self._match(source, target, near, min(number, last))
                partner, row_mass = _partners(matches, target)
                if number <= last:
                    motion = fit_rigid(source.position, partner, row_mass)
                else:
                    covariance = spread(matches, target.position, row_mass)
                    motion = drawn_to(motion, source.position, partner, covariance, row_mass)
                    motion = levelled(
                        motion, source.ground, source.on_ground, target.ground, target.on_ground
                    )
                rounds.append(motion)
            column_mass = matches.column_mass()
            sensor = invert(target.level_from_sensor) @ motion @ source.level_from_sensor
        return EgoMatch(
            target_from_source=sensor,
            level_target_from_source=motion,
            source=source.position,
            row_mass=row_mass,
            column_mass=column_mass,
            source_valid=source.valid,
            target_valid=target.valid,
            rounds=torch.stack(rounds, dim=1),
        )

    def _match(
        self, source: EgoPillars, target: EgoPillars, near: torch.Tensor, number: int
    ) -> SoftMatches:
        """Matches (B, N, N); ``near`` (B, N, N) is what places add to pillars' affinities."""
        slack = nn.functional.softplus(self.offset[number])
        sharpness = 1.0 / (torch.exp(self.scale[number]) + SHARPEST)
        # The affinity is (slack - |f - g|^2) times the sharpness, and |f - g|^2 = 2 - 2 f g; the
        # constants ride along as one more channel, for the matrices are large.
        constant = ((slack - 2.0) * sharpness).expand_as(source.feature[..., :1])
        mine = torch.cat([2.0 * sharpness * source.feature, constant], dim=2)
        theirs = torch.cat([target.feature, torch.ones_like(target.feature[..., :1])], dim=2)
        return sinkhorn(mine @ theirs.transpose(1, 2) + near, self.sinkhorn_rounds)


def _partners(matches: SoftMatches, target: EgoPillars) -> tuple[torch.Tensor, torch.Tensor]:
    """Where what rows are matched with lies, on average: (B, N, 3) metres, and masses (B, N)."""
    position = torch.cat([target.position, torch.ones_like(target.position[..., :1])], dim=2)
    carried = matches.carry(position)
    mass = carried[..., 3]
    return carried[..., :3] / mass.clamp_min(1e-6)[..., None], mass
