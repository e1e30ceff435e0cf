"""How far an object has gone, by how much of it then lies where it lies at other times.

What is seen of a vehicle that passes close by ends where the view of it ends, not where the vehicle
does: its edges and its centroid err together, by a metre. Its wheels, mirrors and pillars do not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import nn

from lidaraccum.model.tubes import LENGTH_M, Tubes, centre_by_time, some_of_each
from lidaraccum.model.unet import deciding


@dataclass(frozen=True)
class Round:
    """Ways tried that differ along one axis.

    Attributes:
        axis: 0 along the object's way, 1 across it, 2 upwards.
        furthest_m: Ways go so much further or less far, at the time furthest from the anchor's.
        steps: How many are tried.
        cell_m: Of the grid on which points are laid over each other: along, across, upwards.
    """

    axis: int
    furthest_m: float
    steps: int
    cell_m: tuple[float, float, float]

    @property
    def order(self) -> tuple[int, int, int]:
        """The axes, that of this round last."""
        first, second = (axis for axis in range(3) if axis != self.axis)
        return first, second, self.axis

    @property
    def cells(self) -> tuple[int, ...]:
        """Of the grid, in that order."""
        return tuple(2 * round(HALF_M[axis] / self.cell_m[axis]) for axis in self.order)


HALF_M = (9.6, 2.4, 2.0)
"""Half of the grid's length, width and height; what lies beyond says nothing."""
ROUNDS = (
    Round(1, 0.5, 21, (0.3, 0.1, 0.25)),
    Round(2, 0.3, 13, (0.3, 0.2, 0.1)),
    Round(0, 2.5, 51, (0.15, 0.2, 0.25)),
    Round(0, 0.6, 25, (0.1, 0.15, 0.25)),
)
FEWEST_POINTS = 10
"""Times that show fewer say nothing."""
_MOST_POINTS = 256
_MOST_OBJECTS = 64
"""So many points of a time are looked up, or up to twice as many less one; objects at once."""

_ON = 2.0
"""What a grid says where there are points; 1 beside them."""

_SHARPNESS = 150.0
"""At first: what agreement counts."""
_CIRCUMSTANCES = 6


class Overlap(nn.Module):
    """The way by which most of an object's points lie where other times have some.

    Each time is laid over the anchor's and over those beside it. Ways go further or less far by the
    same speed at all times, across the course first; which one is taken is weighed against going
    on as is known so far. How much either counts is learned.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        told = channels + _CIRCUMSTANCES
        self.say = nn.ModuleList(deciding(told, 2) for _ in ROUNDS)  # all objects alike at first

    def forward(
        self, tubes: Tubes, said: torch.Tensor, moved: torch.Tensor, gone: torch.Tensor
    ) -> torch.Tensor:
        """What to add (K, T, 3), metres, to how far objects have gone; 0 at the anchor's time.

        Args:
            tubes: Points of K objects over T times.
            said: (K, T, C) what TubeNet thinks of each.
            moved: (Q, 3) the points about their anchors, moved so far.
            gone: (K, T, 3) metres they were shifted so far, ways laid straight.
        """
        seconds = tubes.seconds_by_time()
        axes = _axes((gone * seconds[..., None]).sum(dim=1))
        share = seconds / seconds.abs().amax(dim=1, keepdim=True).clamp_min(1e-3)
        share = torch.where(tubes.fixed(), 0.0, share)
        length = torch.linalg.vector_norm(gone, dim=2).amax(dim=1)
        unit = torch.eye(3, device=moved.device)
        further = moved.new_zeros(len(gone), 3)
        asked = some_of_each(tubes.slot(), tubes.counts.flatten(), _MOST_POINTS)
        place = (axes[tubes.instance] @ _about_middle(tubes, moved)[..., None])[..., 0]
        for one, say in zip(ROUNDS, self.say, strict=True):
            away = torch.linspace(-one.furthest_m, one.furthest_m, one.steps, device=moved.device)
            with torch.no_grad():
                so_far = share[tubes.instance, tubes.time, None] * further[tubes.instance]
                agreement = _agreement(tubes, place + so_far, asked, share, one, away)
            known = torch.cat([said.mean(dim=1), _describe(tubes, agreement, away, length)], dim=1)
            sharper, nearer = say(known).exp().unbind(dim=1)
            odds = _SHARPNESS * sharper[:, None] * agreement
            odds = odds - 0.5 * nearer[:, None] * (away / one.furthest_m) ** 2
            step = (odds.softmax(dim=1) * away).sum(dim=1)
            further = further + step[:, None] * unit[one.axis]
        way = (further[:, None] @ axes)[:, 0]
        return share[..., None] * way[:, None]


def _axes(way: torch.Tensor) -> torch.Tensor:
    """(K, 3, 3) unit vectors along ways (K, 3) seen from above, across them, and upwards.

    Zero along and across a way of no length.
    """
    x, y = nn.functional.normalize(way[:, :2], dim=1).unbind(dim=1)
    zero, one = torch.zeros_like(x), torch.ones_like(x)
    return torch.stack([x, y, zero, -y, x, zero, zero, zero, one], dim=1).view(-1, 3, 3)


def _about_middle(tubes: Tubes, moved: torch.Tensor) -> torch.Tensor:
    """(Q, 3) metres about the middle of an object's places at all times."""
    seen = (tubes.counts > 0)[..., None]
    middle = (centre_by_time(moved, tubes) * seen).sum(dim=1) / seen.sum(dim=1).clamp_min(1)
    return moved - middle[tubes.instance]


def _describe(
    tubes: Tubes, agreement: torch.Tensor, away: torch.Tensor, length: torch.Tensor
) -> torch.Tensor:
    """(K, 6): how the best way agrees, and that so far, how far apart; length, plenty, distance."""
    best, at = agreement.max(dim=1)
    described = [
        best,
        agreement[:, len(away) // 2],
        away[at].abs() / away[-1],
        length / LENGTH_M,
        tubes.plenty().mean(dim=1),
        torch.linalg.vector_norm(tubes.anchor[:, :2], dim=1) / (10.0 * LENGTH_M),
    ]
    return torch.stack(described, dim=1)


def _agreement(
    tubes: Tubes,
    place: torch.Tensor,
    asked: torch.Tensor,
    share: torch.Tensor,
    one: Round,
    away: torch.Tensor,
) -> torch.Tensor:
    """(K, S) 0..1: share of points that lie on others', were objects to go so much further.

    Args:
        tubes: Points of K objects over T times.
        place: (Q, 3) metres along, across, upwards.
        asked: (R,) int64 which of the points are looked up.
        share: (K, T) of what is tried by which each time is shifted, -1..1.
        one: What is tried.
        away: (S,) metres.
    """
    count, slot = len(share), tubes.slot()
    ordered = place[:, one.order]
    cell, on_grid = _cell(ordered, one)
    row = asked[on_grid[asked]]
    weight = 1.0 / torch.bincount(slot[row], minlength=tubes.counts.numel()).to(place.dtype)
    total, pairs = place.new_zeros(count, len(away)), place.new_zeros(count, 1)
    for first in range(0, count, _MOST_OBJECTS):
        mine = (tubes.instance >= first) & (tubes.instance < first + _MOST_OBJECTS)
        grid = _occupied(tubes, cell, on_grid & mine, first, one)
        for index, other in _pairs(tubes, row[mine[row]]):
            owner, time = tubes.instance[index], tubes.time[index]
            further = away * (share[owner, time] - share[owner, other])[:, None]
            along = torch.floor((ordered[index, 2:] + further) / one.cell_m[one.axis]).long()
            along = along + grid.shape[-1] // 2
            inside = (along >= 0) & (along < grid.shape[-1])
            lines = grid[owner - first, other, cell[index, 0], cell[index, 1]]  # (R, cells)
            found = lines.gather(1, along.clamp(0, grid.shape[-1] - 1)).to(place.dtype) * inside
            total.index_add_(0, owner, found * weight[slot[index], None] / _ON)
            pairs.index_add_(0, owner, weight[slot[index], None])
    return total / pairs.clamp_min(1e-6)


def _cell(ordered: torch.Tensor, one: Round) -> tuple[torch.Tensor, torch.Tensor]:
    """Cells (Q, 3) int64 of places (Q, 3), in the round's order, and which are on the grid."""
    size = ordered.new_tensor([one.cell_m[axis] for axis in one.order])
    limit = torch.tensor(one.cells, device=ordered.device)
    cell = torch.floor(ordered / size).long() + limit // 2
    return cell, ((cell >= 0) & (cell < limit)).all(dim=1)


def _occupied(
    tubes: Tubes, cell: torch.Tensor, shown: torch.Tensor, first: int, one: Round
) -> torch.Tensor:
    """(objects, T, *cells) uint8: where objects from ``first`` on have points (Q,) bool."""
    count, span = tubes.counts.shape
    some = min(_MOST_OBJECTS, count - first)
    grid = torch.zeros(some * span, *one.cells, dtype=torch.uint8, device=cell.device)
    grid[tubes.slot()[shown] - first * span, cell[shown, 0], cell[shown, 1], cell[shown, 2]] = 1
    beside = grid
    for axis in (1, 2, 3):
        beside = _widened(beside, axis)
    return (grid + beside).view(some, span, *one.cells)


def _widened(grid: torch.Tensor, axis: int) -> torch.Tensor:
    """A grid and what is beside it along an axis."""
    wide, last = grid.clone(), grid.shape[axis] - 1
    for to, source in ((1, 0), (0, 1)):
        there = wide.narrow(axis, to, last)
        torch.maximum(there, grid.narrow(axis, source, last), out=there)
    return wide


def _pairs(tubes: Tubes, row: torch.Tensor) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
    """Of points (R,) int64 those, and the times, they are laid over: next ones and the anchor's.

    Each pair of times both ways: what cells round off, they round off in opposite directions.
    """
    span = tubes.counts.shape[1]
    owner, time = tubes.instance[row], tubes.time[row]
    anchor = tubes.anchor_time[owner]
    shown = tubes.counts >= FEWEST_POINTS
    for other in range(span):
        beside = (time - other).abs() == 1
        home = (time != other) & ((time == anchor) | (anchor == other))
        both = (beside | home) & shown[owner, other] & shown[owner, time]
        yield row[both], torch.full_like(row[both], other)
