"""TubeNet: the motion of each object, regressed from its points in all frames of a window."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn

from lidaraccum.model.bends import bend_of, bent, unbent
from lidaraccum.model.edges import EdgeShift, StraightOn
from lidaraccum.model.kabsch import chain, compose, exactly, move
from lidaraccum.model.overlap import Overlap
from lidaraccum.model.pooling import tallest
from lidaraccum.model.quaternion import about_vertical, rotation_of
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.tubes import (
    LENGTH_M,
    Tubes,
    centre_by_time,
    centroid_gap,
    move_points,
)
from lidaraccum.model.turns import SideTurn
from lidaraccum.model.unet import linear

ITERATIONS = 2
"""As in the paper's supplement; gradients do not flow from one into the other."""

_SAID = 128
_FAR_M = 50.0


@dataclass(frozen=True, eq=False)
class TubeMotions:
    """What TubeNet proposes for K objects and T times.

    Attributes:
        quaternion: For each iteration, the laying over itself being one more, (K, T, 4), w x y z,
            as regressed, not normalised: of the step that iteration adds.
        shift: For each iteration (K, T, 3) metres: of that step.
        anchor_from_time: For each iteration (K, T, 4, 4): all steps up to it, in coordinates about
            the object's anchor, level axes. The identity for the anchor's own time and for times
            the object was not seen.
    """

    quaternion: tuple[torch.Tensor, ...]
    shift: tuple[torch.Tensor, ...]
    anchor_from_time: tuple[torch.Tensor, ...]


class TubeNet(nn.Module):
    """Regresses, for each object and time, the rigid motion to the object's anchor frame.

    Ours: the turn is what the object's sides say, plus a correction; the shift is what its edges
    and its centroid say, once it is turned, weighted, plus a correction, and drawn towards steady
    motion; at last the object is laid over itself along that way, unless ``tube = "sides"``. The
    net is told from where the object is seen.

    Source: the paper, section 3.5 and supplement.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        wide = settings.tube_channels
        self.motion = nn.Sequential(linear(settings.point_channels, 64), nn.ReLU(inplace=True))
        self.ego = nn.Sequential(linear(settings.base_widths[0], 64), nn.ReLU(inplace=True))
        self.place = nn.Sequential(
            linear(4, 64),
            nn.ReLU(inplace=True),
            linear(64, wide),
            nn.ReLU(inplace=True),
            linear(wide, wide),
        )
        # Normalised, for what comes in is metres: unbounded signals had killed every unit.
        self.regress = nn.Sequential(
            linear(128 + 2 * wide + 12, 256),
            nn.LayerNorm(256),
            nn.ReLU(inplace=True),
            linear(256, _SAID),
            nn.LayerNorm(_SAID),
            nn.ReLU(inplace=True),
        )
        self.last = nn.Linear(_SAID, 7)
        nn.init.normal_(self.last.weight, std=1e-5)
        nn.init.zeros_(self.last.bias)  # the identity: see `_identity`
        self.edges = EdgeShift(_SAID)
        self.straight = StraightOn(_SAID)
        self.sides = SideTurn(_SAID)
        self.overlap = Overlap(_SAID) if settings.tube == "overlap" else None

    def forward(self, tubes: Tubes, motion: torch.Tensor, base: torch.Tensor) -> TubeMotions:
        """Motions of K objects, from features (Q, D) and (Q, C) of their points."""
        if len(tubes.anchor) == 0:
            none = tubes.relative.new_zeros(*tubes.counts.shape, 4, 4)
            return TubeMotions((none[..., 0],), (none[..., :3, 0],), (none,))
        with exactly(tubes.relative):
            return self._iterate(tubes, motion.float(), base.float())

    def _iterate(self, tubes: Tubes, motion: torch.Tensor, base: torch.Tensor) -> TubeMotions:
        count, span = tubes.counts.shape
        general = torch.cat(
            [
                tallest(self.motion(motion), tubes.instance, count),
                tallest(self.ego(base), tubes.instance, count),
            ],
            dim=1,
        )
        total = torch.eye(4, device=motion.device).expand(count, span, 4, 4)
        quaternions, shifts, totals = [], [], []
        for _ in range(ITERATIONS):
            total = total.detach()
            quaternion, shift, said = self._step(tubes, general, total)
            total = chain(compose(rotation_of(quaternion), shift), total)
            quaternions.append(quaternion)
            shifts.append(shift)
            totals.append(total)
        if self.overlap is not None:
            total = total.detach()
            shift = self._lay_over(self.overlap, tubes, said, total)
            quaternions.append(_identity(quaternion))
            shifts.append(shift)
            totals.append(chain(compose(rotation_of(quaternions[-1]), shift), total))
        return TubeMotions(tuple(quaternions), tuple(shifts), tuple(totals))

    def _step(
        self, tubes: Tubes, general: torch.Tensor, total: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Quaternion (K, T, 4) and shift (K, T, 3) of this iteration, and what led to them."""
        count, span = tubes.counts.shape
        moved = move_points(total, tubes)
        gone = _gone(moved, tubes)
        place = self.place(torch.cat([moved / LENGTH_M, tubes.seconds[:, None]], dim=1))
        summary = tallest(torch.relu(place), tubes.slot(), count * span).view(count, span, -1)
        gap = centroid_gap(moved, tubes)
        ahead = torch.arange(span, device=moved.device)[None] - tubes.anchor_time[:, None]
        known = [
            general[:, None].expand(-1, span, -1),
            summary,
            tubes.at_anchor(summary).expand(-1, span, -1),
            ahead[..., None].float() / span,
            gap / LENGTH_M,
            *_circumstances(tubes, gone),
        ]
        said = self.regress(torch.cat(known, dim=2))
        numbers = self.last(said)
        fixed = tubes.fixed()[..., None]
        regressed = torch.where(fixed, 0.0, numbers[..., :4])
        # Without its own real part: that grew, and drowned what was to be turned.
        quaternion = about_vertical(self.sides(tubes, said, moved))
        quaternion = quaternion + nn.functional.pad(regressed[..., 1:], (1, 0))
        turn = rotation_of(quaternion)
        turned, aside = turn_in_place(turn, moved, tubes)
        shift = numbers[..., 4:] + self.edges(tubes, said, turned, gone)
        bend = bend_of(turn @ total[..., :3, :3])
        straightened = unbent(gone + shift, bend)
        shift = aside + shift + bent(self.straight(tubes, said, straightened), bend)
        return quaternion, torch.where(fixed, 0.0, shift), said

    def _lay_over(
        self, overlap: Overlap, tubes: Tubes, said: torch.Tensor, total: torch.Tensor
    ) -> torch.Tensor:
        """Shifts (K, T, 3) along the ways that objects, moved so far, are on."""
        moved = move_points(total, tubes)
        bend = bend_of(total[..., :3, :3])
        return bent(overlap(tubes, said, moved, unbent(_gone(moved, tubes), bend)), bend)


def _gone(moved: torch.Tensor, tubes: Tubes) -> torch.Tensor:
    """(K, T, 3) metres that objects' middles were moved, their points (Q, 3) moved so far."""
    return centre_by_time(moved, tubes) - centre_by_time(tubes.relative, tubes)


def _circumstances(tubes: Tubes, gone: torch.Tensor) -> list[torch.Tensor]:
    """(K, T, 2 + 1 + 1 + 1 + 3): from where the object is seen, by how much, how far it is gone."""
    span = tubes.counts.shape[1]
    distance = torch.linalg.vector_norm(tubes.anchor[:, :2], dim=1)
    plenty = tubes.plenty()[..., None]
    return [
        tubes.bearing()[:, None].expand(-1, span, -1),
        (distance / _FAR_M)[:, None, None].expand(-1, span, -1),
        plenty,
        tubes.at_anchor(plenty).expand(-1, span, -1),
        gone / LENGTH_M,
    ]


def turn_in_place(
    turn: torch.Tensor, moved: torch.Tensor, tubes: Tubes
) -> tuple[torch.Tensor, torch.Tensor]:
    """Points (Q, 3), each object's turned about its centroid at each time by (K, T, 3, 3).

    And the shifts (K, T, 3) of turns about the anchor that do the same.
    """
    centre = centre_by_time(moved, tubes)
    aside = centre - (turn @ centre[..., None])[..., 0]
    mine = compose(turn, aside)[tubes.instance, tubes.time]
    return move(mine, moved[:, None])[:, 0], aside


def _identity(numbers: torch.Tensor) -> torch.Tensor:
    one = torch.zeros_like(numbers[..., :4])
    one[..., 0] = 1.0
    return one
