"""Ego-motion: matched background pillars of two frames, and the rigid motion between them."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn

from lidaraccum.model.batch import FrameTensors
from lidaraccum.model.kabsch import exactly, fit_rigid, invert
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.sinkhorn import sinkhorn

SHARP_START = -5.0
"""Where offset and scale of the affinity start; a soft start does not learn."""
SHARPEST = 0.02
_LEAST_REACH_M = 1.0


@dataclass(frozen=True, eq=False)
class EgoPillars:
    """The N background pillars that speak for each of F frames.

    Attributes:
        position: (F, N, 3) float32, metres: mean of the pillar's points, level coordinates.
        feature: (F, N, E) unit vectors.
        valid: (F, N) bool: False where the frame has too little background.
        level_from_sensor: (F, 4, 4).
    """

    position: torch.Tensor
    feature: torch.Tensor
    valid: torch.Tensor
    level_from_sensor: torch.Tensor

    def pick(self, index: torch.Tensor) -> EgoPillars:
        """Frames (K,) int64, in that order."""
        return EgoPillars(
            self.position[index],
            self.feature[index],
            self.valid[index],
            self.level_from_sensor[index],
        )

    @staticmethod
    def stack(parts: list[EgoPillars]) -> EgoPillars:
        """Several put one after another."""
        return EgoPillars(
            torch.cat([part.position for part in parts]),
            torch.cat([part.feature for part in parts]),
            torch.cat([part.valid for part in parts]),
            torch.cat([part.level_from_sensor for part in parts]),
        )


@dataclass(frozen=True, eq=False)
class EgoMatch:
    """Proposed motions between B pairs of frames.

    Attributes:
        target_from_source: (B, 4, 4) float32, sensor coordinates.
        level_target_from_source: (B, 4, 4) the same between level coordinates.
        source: (B, N, 3) the source pillars, level coordinates, metres.
        row_mass: (B, N) 0..1: how far a source pillar found partners; 0 where it is not valid.
        column_mass: (B, N) 0..1, of target pillars.
        source_valid: (B, N) bool.
        target_valid: (B, N) bool.
    """

    target_from_source: torch.Tensor
    level_target_from_source: torch.Tensor
    source: torch.Tensor
    row_mass: torch.Tensor
    column_mass: torch.Tensor
    source_valid: torch.Tensor
    target_valid: torch.Tensor


class EgoHead(nn.Module):
    """Features of a few pillars: two 3 x 3 convolutions, run on those pillars' 5 x 5 patches only.

    The paper runs them over the whole map and reads 1024 of 65 536 cells. No batch norm, so that a
    frame's features do not depend on its company.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        channels = settings.ego_channels
        self.inner = nn.Conv2d(settings.base_widths[0], channels, 3)
        self.outer = nn.Conv2d(channels, channels, 3)

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
    frames: FrameTensors, foreground: torch.Tensor, count: int, seed: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Pick pillars of each frame at random, background first: indices and validity (F, count).

    Args:
        frames: F frames with V pillars.
        foreground: (V,) logits; above 0 is not background.
        count: Pillars a frame.
        seed: Another one, another choice. The choice depends on the frame's own points and on
            nothing else: not on their order, nor on the frame's company.
    """
    owner = frames.pillar_frame
    points = torch.tensor(frames.point_counts, device=owner.device)
    key = _hash(frames.pillar_cell + 65536 * 7 * points[owner] + 1_000_003 * seed)
    key = key + (foreground > 0) + 2.0 * owner  # background below 1, foreground above, by frame
    order = torch.argsort(key)
    starts = torch.tensor((0, *frames.pillar_counts[:-1]), device=owner.device).cumsum(0)
    rank = torch.arange(len(order), device=owner.device) - starts[owner]
    kept = order[rank < count]
    index = torch.zeros(len(frames), count, dtype=torch.int64, device=owner.device)
    valid = torch.zeros(len(frames), count, dtype=torch.bool, device=owner.device)
    slot = owner[rank < count] * count + rank[rank < count]
    index.view(-1)[slot] = kept
    valid.view(-1)[slot] = foreground[kept] <= 0
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

    Source: the paper, section 3.2 and supplement; the affinity's form from METHOD.md.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        self.offset = nn.Parameter(torch.tensor(SHARP_START))
        self.scale = nn.Parameter(torch.tensor(SHARP_START))
        self.rounds = settings.sinkhorn_rounds
        self.fastest_mps = settings.fastest_mps

    def forward(self, source: EgoPillars, target: EgoPillars, gap_s: torch.Tensor) -> EgoMatch:
        """Motions between B pairs of frames, ``gap_s`` (B,) seconds apart; float32 throughout."""
        with exactly(source.position):
            matches = sinkhorn(self._affinity(source, target, gap_s), self.rounds)
            row_mass = matches.sum(dim=2)
            partner = matches @ target.position / row_mass.clamp_min(1e-6)[..., None]
            motion = fit_rigid(source.position, partner, row_mass)
            sensor = invert(target.level_from_sensor) @ motion @ source.level_from_sensor
        return EgoMatch(
            target_from_source=sensor,
            level_target_from_source=motion,
            source=source.position,
            row_mass=row_mass,
            column_mass=matches.sum(dim=1),
            source_valid=source.valid,
            target_valid=target.valid,
        )

    def _affinity(
        self, source: EgoPillars, target: EgoPillars, gap_s: torch.Tensor
    ) -> torch.Tensor:
        cosine = source.feature @ target.feature.transpose(1, 2)
        distance = 2.0 - 2.0 * cosine  # squared, of unit vectors
        slack = nn.functional.softplus(self.offset)
        affinity = -(distance - slack) / (torch.exp(self.scale) + SHARPEST)
        reach = (self.fastest_mps * gap_s.abs()).clamp_min(_LEAST_REACH_M)
        apart = torch.cdist(source.position[..., :2], target.position[..., :2])
        possible = (apart < reach[:, None, None]) & target.valid[:, None, :]
        possible = possible & source.valid[:, :, None]
        return affinity.masked_fill(~possible, -torch.inf)
