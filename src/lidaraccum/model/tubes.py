"""Points of objects over time, as TubeNet sees them."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from lidaraccum.model.kabsch import move

LENGTH_M = 4.0
"""About that of a car: positions are told in it."""
_MOST_CELLS = 2**15
"""Cells in each direction from the origin of coordinates."""


@dataclass(frozen=True, eq=False)
class Tubes:
    """Q points of K objects over T times each, about each object's anchor.

    The anchor is the mean of an object's points in the target frame, or, where it has none there,
    in the frame nearest to it.

    Attributes:
        instance: (Q,) int64 object of each point, 0..K-1.
        time: (Q,) int64 rank of the point's frame in its window, 0..T-1.
        anchor: (K, 3) metres, target's level coordinates.
        anchor_time: (K,) int64 rank of the anchor's frame.
        counts: (K, T) int64 points.
        relative: (Q, 3) metres: positions less the anchor.
        seconds: (Q,) from the anchor's frame.
    """

    instance: torch.Tensor
    time: torch.Tensor
    anchor: torch.Tensor
    anchor_time: torch.Tensor
    counts: torch.Tensor
    relative: torch.Tensor
    seconds: torch.Tensor

    def slot(self) -> torch.Tensor:
        """(Q,) int64, 0..K T-1: each point's object and time in one number."""
        return self.instance * self.counts.shape[1] + self.time

    def fixed(self) -> torch.Tensor:
        """(K, T) bool: the anchor's own time, and times the object was not seen; nothing moves."""
        ranks = torch.arange(self.counts.shape[1], device=self.counts.device)
        return (self.counts == 0) | (ranks[None] == self.anchor_time[:, None])

    def at_anchor(self, values: torch.Tensor) -> torch.Tensor:
        """(K, 1, ...): of values (K, T, ...), those at the anchor's time."""
        rows = torch.arange(len(values), device=values.device)
        return values[rows, self.anchor_time][:, None]

    def bearing(self) -> torch.Tensor:
        """(K, 2) unit vectors from the target's sensor to the anchors, seen from above."""
        flat = self.anchor[:, :2]
        return flat / torch.linalg.vector_norm(flat, dim=1, keepdim=True).clamp_min(1e-3)

    def plenty(self) -> torch.Tensor:
        """(K, T) how many points, as a logarithm, about 0 to 1."""
        return torch.log1p(self.counts.float()) / 8.0

    def seconds_by_time(self) -> torch.Tensor:
        """(K, T) seconds from the anchor's frame; 0 for times the object was not seen."""
        sums = self.seconds.new_zeros(self.counts.numel()).index_add(0, self.slot(), self.seconds)
        return sums.view(self.counts.shape) / self.counts.clamp_min(1)


def gather_tubes(
    position: torch.Tensor,
    instance: torch.Tensor,
    time: torch.Tensor,
    seconds: torch.Tensor,
    target_time: torch.Tensor,
    count: int,
) -> Tubes:
    """Tubes of ``count`` objects from points with ids.

    Args:
        position: (Q, 3) metres, ego-aligned: target's level coordinates.
        instance: (Q,) int64, 0..count-1; each has at least one point.
        time: (Q,) int64 rank of the point's frame in its window.
        seconds: (Q,) of the point's frame from the target.
        target_time: (count,) rank of the target frame in the object's window.
        count: Number of objects, K.
    """
    span = int(time.max()) + 1 if len(time) else 1
    slot = instance * span + time
    counts = torch.bincount(slot, minlength=count * span)
    sums = position.new_zeros(count * span, 3).index_add(0, slot, position)
    sum_seconds = seconds.new_zeros(count * span).index_add(0, slot, seconds)
    ranks = torch.arange(span, device=time.device)
    away = (ranks[None] - target_time[:, None]).abs() * 2 + (ranks[None] > target_time[:, None])
    seen = counts.view(count, span) > 0
    anchor_time = away.masked_fill(~seen, 4 * span).argmin(dim=1)
    home = torch.arange(count, device=time.device) * span + anchor_time
    share = counts[home].clamp_min(1)
    anchor = sums[home] / share[:, None]
    anchor_seconds = sum_seconds[home] / share
    return Tubes(
        instance=instance,
        time=time,
        anchor=anchor,
        anchor_time=anchor_time,
        counts=counts.view(count, span),
        relative=position - anchor[instance],
        seconds=seconds - anchor_seconds[instance],
    )


def one_of_each_cell(position: torch.Tensor, slot: torch.Tensor, cell_m: float) -> torch.Tensor:
    """(M,) int64, ascending: one of the points (Q, 3) in each cell, slot (Q,) by slot.

    What is near shows many points of few places; thinned, it shows what is seen of it.
    """
    cell = torch.floor(position / cell_m).long().clamp(-_MOST_CELLS, _MOST_CELLS - 1)
    key = slot
    for axis in cell.unbind(dim=1):
        key = key * (2 * _MOST_CELLS) + axis + _MOST_CELLS
    _, place = torch.unique(key, return_inverse=True)
    count = int(place.max()) + 1 if len(place) else 0
    rows = torch.arange(len(place), device=place.device)
    first = torch.full((count,), len(place), device=place.device)
    return torch.sort(first.scatter_reduce(0, place, rows, "amin")).values


def some_of_each(slot: torch.Tensor, counts: torch.Tensor, most: int) -> torch.Tensor:
    """(R,) int64: every so many points of each slot, in order: up to twice ``most`` less one.

    Args:
        slot: (Q,) int64, 0..S-1.
        counts: (S,) int64 of points in each.
        most: How many are enough.
    """
    order = torch.argsort(slot, stable=True)
    rank = torch.arange(len(slot), device=slot.device) - (counts.cumsum(0) - counts)[slot[order]]
    return order[rank % (counts // most).clamp_min(1)[slot[order]] == 0]


def centre_by_time(moved: torch.Tensor, tubes: Tubes) -> torch.Tensor:
    """(K, T, 3) metres: mean of an object's moved points (Q, 3) at each time; 0 for none."""
    sums = moved.new_zeros(tubes.counts.numel(), 3).index_add(0, tubes.slot(), moved)
    return sums.view(*tubes.counts.shape, 3) / tubes.counts.clamp_min(1)[..., None]


def centroid_gap(moved: torch.Tensor, tubes: Tubes) -> torch.Tensor:
    """(K, T, 3) metres from the mean of an object's moved points (Q, 3) to that at its anchor.

    Most of a shift, had for nothing; what share of it is motion, and what share another view of
    the same sides, is for the net to say.
    """
    mean = centre_by_time(moved, tubes)
    return torch.where(tubes.counts[..., None] > 0, tubes.at_anchor(mean) - mean, 0.0)


def move_points(total: torch.Tensor, tubes: Tubes) -> torch.Tensor:
    """(Q, 3) points about their anchors, moved by what (K, T, 4, 4) moves their object then."""
    mine = total[tubes.instance, tubes.time]
    return move(mine, tubes.relative[:, None])[:, 0]
