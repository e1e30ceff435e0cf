"""How far an object has gone along its way, by how much of it then lies where it lay before.

What is seen of a vehicle that passes close by ends where the view of it ends, not where the vehicle
does: its edges and its centroid err together, by a metre. Its wheels, mirrors and pillars do not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import nn

from lidaraccum.model.tubes import LENGTH_M, Tubes, centre_by_time, some_of_each

CELLS = (24, 16, 128)
CELL_M = (0.2, 0.25, 0.15)
"""Of the grid on which points are laid over each other: across the way, upwards, along it."""
FURTHEST_M = 2.5
_STEPS = 51
"""Ways tried go this much further or less far, at the time furthest from the anchor's."""
FEWEST_POINTS = 10
"""Times that show fewer say nothing."""
_MOST_POINTS = 256
_MOST_OBJECTS = 64
"""So many points of a time are looked up, or up to twice as many less one; objects at once."""

_SHARPNESS = 150.0
"""At first: what agreement counts."""
_CIRCUMSTANCES = 6


class Overlap(nn.Module):
    """The way along its course by which most of an object's points lie where other times have some.

    Each time is laid over the anchor's and over those beside it. Ways go further or less far by the
    same speed at all times; which one is taken is weighed against going on as is known so far. How
    much either counts is learned.
    """

    further: torch.Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        last = nn.Linear(32, 2)
        nn.init.normal_(last.weight, std=1e-3)  # all objects alike at first
        nn.init.zeros_(last.bias)
        self.say = nn.Sequential(
            nn.Linear(channels + _CIRCUMSTANCES, 32), nn.ReLU(inplace=True), last
        )
        further = torch.linspace(-FURTHEST_M, FURTHEST_M, _STEPS)
        self.register_buffer("further", further, persistent=False)

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
        speed = (gone[..., :2] * seconds[..., None]).sum(dim=1)
        course = nn.functional.normalize(speed, dim=1)
        share = seconds / seconds.abs().amax(dim=1, keepdim=True).clamp_min(1e-3)
        with torch.no_grad():
            agreement = self._agreement(tubes, moved, course, share)
        length = torch.linalg.vector_norm(gone, dim=2).amax(dim=1)
        known = [said.mean(dim=1), *self._describe(tubes, agreement, length)]
        sharper, nearer = self.say(torch.cat(known, dim=1)).exp().unbind(dim=1)
        odds = _SHARPNESS * sharper[:, None] * agreement
        odds = odds - 0.5 * nearer[:, None] * (self.further / FURTHEST_M) ** 2
        further = (odds.softmax(dim=1) * self.further).sum(dim=1)
        along = (further[:, None] * torch.where(tubes.fixed(), 0.0, share))[..., None]
        return torch.cat([along * course[:, None], torch.zeros_like(along)], dim=2)

    def _describe(
        self, tubes: Tubes, agreement: torch.Tensor, length: torch.Tensor
    ) -> list[torch.Tensor]:
        """(K, 6): how well the best way agrees and that so far, by how far; plenty, distance."""
        best, at = agreement.max(dim=1)
        none = agreement[:, _STEPS // 2]
        distance = torch.linalg.vector_norm(tubes.anchor[:, :2], dim=1)
        described = [
            best,
            none,
            self.further[at].abs() / FURTHEST_M,
            length / LENGTH_M,
            tubes.plenty().mean(dim=1),
            distance / (10.0 * LENGTH_M),
        ]
        return [one[:, None] for one in described]

    def _agreement(
        self, tubes: Tubes, moved: torch.Tensor, course: torch.Tensor, share: torch.Tensor
    ) -> torch.Tensor:
        """(K, S) 0..1: share of points that lie on others', were objects to go so much further.

        Args:
            tubes: Points of K objects over T times.
            moved: (Q, 3) about the anchors, moved so far.
            course: (K, 2) unit vectors.
            share: (K, T) of what is tried by which each time is shifted, -1..1.
        """
        count = len(course)
        total = moved.new_zeros(count, _STEPS)
        pairs = moved.new_zeros(count, 1)
        place = _along_course(tubes, moved, course)
        for first in range(0, count, _MOST_OBJECTS):
            laid = _Laid.of(tubes, place, first)
            for row, time, other in laid.pairs(tubes):
                ahead = place[row, 2:] + self.further * (
                    share[tubes.instance[row], time] - share[tubes.instance[row], other]
                ).unsqueeze(1)
                weight = 1.0 / laid.asked[tubes.slot()[row]][:, None]
                found = laid.at(tubes.instance[row], other, place[row], ahead)
                total.index_add_(0, tubes.instance[row], found * weight)
                pairs.index_add_(0, tubes.instance[row], weight)
        return total / pairs.clamp_min(1e-6)


@dataclass(frozen=True, eq=False)
class _Laid:
    """Some of the objects' points on a grid each, for every time.

    Attributes:
        first: The first of the objects.
        occupied: (objects, T, across, up, along) uint8: 2 where there are points, 1 beside them.
        row: (R,) int64 which of the Q points are looked up: some of each time, on the grid.
        asked: (K T,) how many they are of each time.
    """

    first: int
    occupied: torch.Tensor
    row: torch.Tensor
    asked: torch.Tensor

    @classmethod
    def of(cls, tubes: Tubes, place: torch.Tensor, first: int) -> _Laid:
        """Of up to so many objects from ``first`` on; place (Q, 3) from `_along_course`."""
        count, span = tubes.counts.shape
        some = min(_MOST_OBJECTS, count - first)
        mine = (tubes.instance >= first) & (tubes.instance < first + some)
        on_grid = mine & _cell(place)[1]
        cell = _cell(place[on_grid])[0]
        slot = tubes.slot()[on_grid] - first * span
        occupied = torch.zeros(some * span, *CELLS, dtype=torch.uint8, device=place.device)
        across, up, along = cell.unbind(dim=1)
        occupied[slot, across, up, along] = 1
        beside = occupied
        for axis in (1, 2, 3):
            beside = _widened(beside, axis)
        row = some_of_each(tubes.slot(), tubes.counts.flatten(), _MOST_POINTS)
        row = row[on_grid[row]]
        asked = torch.bincount(tubes.slot()[row], minlength=count * span).to(place.dtype)
        return cls(first, (occupied + beside).view(some, span, *CELLS), row, asked)

    def pairs(self, tubes: Tubes) -> Iterator[tuple[torch.Tensor, torch.Tensor, torch.Tensor]]:
        """Points (R',) int64, their times, and times they are laid over: anchors', next, before."""
        span = tubes.counts.shape[1]
        object_of, time = tubes.instance[self.row], tubes.time[self.row]
        anchor = tubes.anchor_time[object_of]
        shown = tubes.counts >= FEWEST_POINTS
        for other, wanted in (
            (anchor, time != anchor),
            (time + 1, (time + 1 != anchor) & (time + 1 < span)),
            (time - 1, (time - 1 != anchor) & (time > 0)),
        ):
            there = other.clamp(0, span - 1)
            both = wanted & shown[object_of, there] & shown[object_of, time]
            yield self.row[both], time[both], there[both]

    def at(
        self,
        object_of: torch.Tensor,
        time: torch.Tensor,
        place: torch.Tensor,
        along: torch.Tensor,
    ) -> torch.Tensor:
        """(R', S) 0..1: what there is at a time (R',) where points (R', 3) get, (R', S) along."""
        cell, _ = _cell(place)
        further = torch.floor(along / CELL_M[2]).long() + CELLS[2] // 2
        inside = (further >= 0) & (further < CELLS[2])
        rows = self.occupied[object_of - self.first, time, cell[:, 0], cell[:, 1]]  # (R', along)
        return rows.gather(1, further.clamp(0, CELLS[2] - 1)).to(along.dtype) * inside / 2.0


def _along_course(tubes: Tubes, moved: torch.Tensor, course: torch.Tensor) -> torch.Tensor:
    """(Q, 3) metres about the middle of all times: across the course, upwards, along it."""
    seen = (tubes.counts > 0)[..., None]
    middle = (centre_by_time(moved, tubes) * seen).sum(dim=1) / seen.sum(dim=1).clamp_min(1)
    about = moved - middle[tubes.instance]
    x, y = course[tubes.instance].unbind(dim=1)
    across = about[:, 1] * x - about[:, 0] * y
    return torch.stack([across, about[:, 2], about[:, 0] * x + about[:, 1] * y], dim=1)


def _cell(place: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Cells (Q, 3) int64 of places (Q, 3), and which of them are on the grid."""
    size, limit = place.new_tensor(CELL_M), torch.tensor(CELLS, device=place.device)
    cell = torch.floor(place / size).long() + limit // 2
    return cell, ((cell >= 0) & (cell < limit)).all(dim=1)


def _widened(grid: torch.Tensor, axis: int) -> torch.Tensor:
    """A grid and what is beside it along an axis."""
    wide, last = grid.clone(), grid.shape[axis] - 1
    for to, source in ((1, 0), (0, 1)):
        there = wide.narrow(axis, to, last)
        torch.maximum(there, grid.narrow(axis, source, last), out=there)
    return wide
