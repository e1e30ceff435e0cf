"""Clusters as association delivers them: merged, cut in two, thinned, with background in them."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from lidaraccum.errors import SettingsError

MERGE_REACH_M = 4.0
"""Objects further apart than this are not taken for one."""
HALO_M = 0.5
"""Background this close to an object's outline is taken for a part of it."""
STRAY_M = 3.0
"""Strays come from this far beyond it."""
STRAYS = 0.03
"""So many of an object's points at most."""


@dataclass(frozen=True)
class ClusterSettings:
    """How often clusters are wrong; all 0 leaves the true objects.

    Attributes:
        merged: Chance that an object swallows its nearest neighbour.
        split: Chance that an object is cut in two.
        thinned: Chance that an object loses a third of its points.
        background: Chance that an object takes along the background about it.
        strays: Chance that an object takes along a few points that lie apart from it.
    """

    merged: float = 0.1
    split: float = 0.15
    thinned: float = 0.25
    background: float = 0.3
    strays: float = 0.4

    def __post_init__(self) -> None:
        for name in ("merged", "split", "thinned", "background", "strays"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise SettingsError(f"{name} is a chance of 0 to 1, not {getattr(self, name)}")


TRUE_CLUSTERS = ClusterSettings(0.0, 0.0, 0.0, 0.0, 0.0)


def imperfect_clusters(
    position: torch.Tensor,
    row: torch.Tensor,
    window: torch.Tensor,
    settings: ClusterSettings,
    generator: torch.Generator,
) -> torch.Tensor:
    """Cluster ids (Q,) int64, 0 for none, of points whose true objects are known.

    Args:
        position: (Q, 3) metres, ego-aligned.
        row: (Q,) int64 true object, -1 for none.
        window: (Q,) int64 window of the point.
        settings: How often clusters are wrong.
        generator: On the CPU; decides.
    """
    if len(row) == 0 or int(row.max()) < 0:
        return torch.zeros_like(row)
    count = int(row.max()) + 1
    chance = torch.rand(6, count, generator=generator).to(row.device)
    angle = (torch.rand(count, generator=generator) * torch.pi).to(row.device)
    lost = torch.rand(len(row), generator=generator).to(row.device) < 1 / 3
    chosen = torch.rand(len(row), generator=generator).to(row.device)
    has = row >= 0
    centre, radius, home = _outlines(position[has], row[has], window[has], count)
    cluster = row.clone()
    cluster = _swallow_background(
        cluster, position, window, (centre, radius, home), chance[3] < settings.background
    )
    cluster = _merge(cluster, centre, home, chance[0] < settings.merged)
    member = cluster.clamp_min(0)
    away = ((position[:, :2] - centre[member]) * _direction(angle)[member]).sum(dim=1)
    cut = (chance[1] < settings.split)[member] & (away > 0) & (cluster >= 0)
    share = torch.where(chance[4] < settings.strays, STRAYS * chance[5], 0.0)
    taken = _strays(row, position, window, (centre, radius, home), share, chosen)
    thin = (chance[2] < settings.thinned)[member] & lost
    cluster = torch.where(cut, cluster + count, cluster)
    cluster = torch.where(thin, -1, cluster)
    return torch.where(taken >= 0, taken, cluster) + 1


def truth_of_clusters(
    cluster: torch.Tensor, row: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """What each cluster mostly is: ids (C,) ascending and rows (C,) of true objects, -1 for none.

    Args:
        cluster: (Q,) int64 ids, 0 for none.
        row: (Q,) int64 true object, -1 for none.
    """
    inside = cluster > 0
    ids, place = torch.unique(cluster[inside], return_inverse=True)
    width = int(row.max()) + 2 if len(row) else 1
    votes = torch.bincount(place * width + row[inside] + 1, minlength=len(ids) * width)
    return ids, votes.view(len(ids), width).argmax(dim=1) - 1


def _direction(angle: torch.Tensor) -> torch.Tensor:
    return torch.stack([torch.cos(angle), torch.sin(angle)], dim=1)


def _outlines(
    position: torch.Tensor, row: torch.Tensor, window: torch.Tensor, count: int
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Centre (K, 2), radius (K,) and window (K,) of objects; far away where one has no point."""
    xy = position[:, :2]
    points = torch.bincount(row, minlength=count)
    centre = xy.new_zeros(count, 2).index_add(0, row, xy) / points.clamp_min(1)[:, None]
    away = torch.linalg.vector_norm(xy - centre[row], dim=1)
    radius = away.new_zeros(count).scatter_reduce(0, row, away, "amax")
    home = torch.full((count,), -1, dtype=window.dtype, device=window.device)
    return centre, radius, home.index_copy(0, row, window)


def _strays(
    row: torch.Tensor,
    position: torch.Tensor,
    window: torch.Tensor,
    outlines: tuple[torch.Tensor, torch.Tensor, torch.Tensor],
    share: torch.Tensor,
    chosen: torch.Tensor,
) -> torch.Tensor:
    """Objects (Q,) that take points which are not theirs, -1 for none.

    Each takes about ``share`` (K,) of the number of its own; ``chosen`` (Q,) decides.
    """
    nearest = _nearest_in_reach(position, row, window, outlines, STRAY_M, share > 0.0)
    offered = nearest >= 0
    count = torch.bincount(nearest[offered], minlength=len(share)).clamp_min(1)
    size = torch.bincount(row[row >= 0], minlength=len(share))
    chance = share * size / count
    return torch.where(offered & (chosen < chance[nearest]), nearest, -1)


def _merge(
    cluster: torch.Tensor, centre: torch.Tensor, home: torch.Tensor, eager: torch.Tensor
) -> torch.Tensor:
    """Eager objects give their id to their nearest neighbour's points."""
    apart = torch.cdist(centre, centre)
    apart = apart.masked_fill(home[:, None] != home[None], torch.inf).fill_diagonal_(torch.inf)
    distance, neighbour = apart.min(dim=1)
    becomes = torch.arange(len(centre), device=cluster.device)
    swapped = eager[neighbour] & (neighbour < becomes)  # two that want each other would change ids
    takes = torch.nonzero(eager & ~swapped & (distance < MERGE_REACH_M) & (home >= 0))[:, 0]
    becomes[neighbour[takes]] = takes
    return torch.where(cluster >= 0, becomes[cluster.clamp_min(0)], cluster)


def _swallow_background(
    cluster: torch.Tensor,
    position: torch.Tensor,
    window: torch.Tensor,
    outlines: tuple[torch.Tensor, torch.Tensor, torch.Tensor],
    eager: torch.Tensor,
) -> torch.Tensor:
    """Background within the halo of eager objects joins them."""
    loose = torch.nonzero(cluster < 0)[:, 0]
    if len(loose) == 0:
        return cluster
    joins = _nearest_in_reach(
        position[loose], cluster[loose], window[loose], outlines, HALO_M, eager
    )
    return cluster.index_copy(0, loose, joins)


def _nearest_in_reach(
    position: torch.Tensor,
    row: torch.Tensor,
    window: torch.Tensor,
    outlines: tuple[torch.Tensor, torch.Tensor, torch.Tensor],
    beyond_m: float,
    eager: torch.Tensor,
) -> torch.Tensor:
    """The nearest eager object (Q,) whose outline is so near and which is not ``row``; else -1."""
    centre, radius, home = outlines
    apart = torch.cdist(position[:, :2], centre)
    reachable = (window[:, None] == home) & (apart < radius + beyond_m) & eager
    reachable &= row[:, None] != torch.arange(len(centre), device=row.device)
    distance, nearest = apart.masked_fill(~reachable, torch.inf).min(dim=1)
    return torch.where(torch.isfinite(distance), nearest, -1)
