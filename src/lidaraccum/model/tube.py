"""TubeNet: the motion of each object, regressed from its points in all frames of a window."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn

from lidaraccum.model.kabsch import chain, compose, move
from lidaraccum.model.pooling import tallest
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.unet import linear

_LENGTH_M = 4.0
"""About that of a car: positions are told in it."""

ITERATIONS = 2
"""As in the paper's supplement; gradients do not flow from one into the other."""


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


@dataclass(frozen=True, eq=False)
class TubeMotions:
    """What TubeNet proposes for K objects and T times.

    Attributes:
        quaternion: For each iteration (K, T, 4), w x y z, as regressed, not normalised: of the
            step that iteration adds.
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

    Ours: the shift is a share of the gap between the object's centroids plus a correction.

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
            linear(128 + 2 * wide + 4, 256),
            nn.LayerNorm(256),
            nn.ReLU(inplace=True),
            linear(256, 128),
            nn.LayerNorm(128),
            nn.ReLU(inplace=True),
        )
        self.last = nn.Linear(128, 8)
        nn.init.normal_(self.last.weight, std=1e-5)
        nn.init.zeros_(self.last.bias)  # the identity: see `_identity`

    def forward(self, tubes: Tubes, motion: torch.Tensor, base: torch.Tensor) -> TubeMotions:
        """Motions of K objects, from features (Q, D) and (Q, C) of their points."""
        count, span = tubes.counts.shape
        general = torch.cat(
            [
                tallest(self.motion(motion).float(), tubes.instance, count),
                tallest(self.ego(base).float(), tubes.instance, count),
            ],
            dim=1,
        )
        fixed = (tubes.counts == 0) | (
            torch.arange(span, device=motion.device)[None] == tubes.anchor_time[:, None]
        )
        total = torch.eye(4, device=motion.device).expand(count, span, 4, 4)
        quaternions, shifts, totals = [], [], []
        for _ in range(ITERATIONS):
            total = total.detach()
            moved = _move_points(total, tubes)
            numbers = self._step(tubes, general, moved).float()
            numbers = torch.where(fixed[..., None], 0.0, numbers)
            quaternion, shift = _identity(numbers) + numbers[..., :4], numbers[..., 4:]
            total = chain(compose(rotation_of(quaternion), shift), total)
            quaternions.append(quaternion)
            shifts.append(shift)
            totals.append(total)
        return TubeMotions(tuple(quaternions), tuple(shifts), tuple(totals))

    def _step(self, tubes: Tubes, general: torch.Tensor, moved: torch.Tensor) -> torch.Tensor:
        """(K, T, 7) quaternion less the identity, and shift, of this iteration."""
        count, span = tubes.counts.shape
        place = self.place(torch.cat([moved / _LENGTH_M, tubes.seconds[:, None]], dim=1))
        summary = tallest(
            torch.relu(place).float(), tubes.instance * span + tubes.time, count * span
        ).view(count, span, -1)
        rows = torch.arange(count, device=moved.device)
        at_anchor = summary[rows, tubes.anchor_time][:, None].expand(-1, span, -1)
        gap = _centroid_gap(moved, tubes)
        ahead = torch.arange(span, device=moved.device)[None] - tubes.anchor_time[:, None]
        said = torch.cat(
            [
                general[:, None].expand(-1, span, -1),
                summary,
                at_anchor,
                ahead[..., None].float() / span,
                gap / _LENGTH_M,
            ],
            dim=2,
        )
        numbers = self.last(self.regress(said)).float()
        return torch.cat([numbers[..., :4], numbers[..., 4:7] + numbers[..., 7:] * gap], dim=2)


def _identity(numbers: torch.Tensor) -> torch.Tensor:
    one = torch.zeros_like(numbers[..., :4])
    one[..., 0] = 1.0
    return one


def _centroid_gap(moved: torch.Tensor, tubes: Tubes) -> torch.Tensor:
    """(K, T, 3) metres from the mean of an object's moved points (Q, 3) to that at its anchor.

    Most of a shift, had for nothing; what share of it is motion, and what share another view of
    the same sides, is for the net to say.
    """
    count, span = tubes.counts.shape
    slot = tubes.instance * span + tubes.time
    sums = moved.new_zeros(count * span, 3).index_add(0, slot, moved)
    mean = sums.view(count, span, 3) / tubes.counts.clamp_min(1)[..., None]
    anchor = mean[torch.arange(count, device=mean.device), tubes.anchor_time]
    return torch.where(tubes.counts[..., None] > 0, anchor[:, None] - mean, 0.0)


def _move_points(total: torch.Tensor, tubes: Tubes) -> torch.Tensor:
    """(Q, 3) points about their anchors, moved by their object's motion at their time."""
    mine = total[tubes.instance, tubes.time]
    return move(mine, tubes.relative[:, None])[:, 0]


def rotation_of(quaternion: torch.Tensor) -> torch.Tensor:
    """Rotation (..., 3, 3) of a quaternion (..., 4), w x y z, of any length but 0."""
    w, x, y, z = nn.functional.normalize(quaternion, dim=-1).unbind(-1)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)


def quaternion_of(rotation: torch.Tensor) -> torch.Tensor:
    """Unit quaternion (..., 4), w x y z with w 0 or more, of a rotation (..., 3, 3).

    The largest eigenvector of a symmetric matrix (Bar-Itzhack, 2000), so half turns are safe.
    """
    r = rotation.double()
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (row.unbind(-1) for row in r.unbind(-2))
    rows = [
        [xx + yy + zz, zy - yz, xz - zx, yx - xy],
        [zy - yz, xx - yy - zz, xy + yx, xz + zx],
        [xz - zx, xy + yx, yy - xx - zz, yz + zy],
        [yx - xy, xz + zx, yz + zy, zz - xx - yy],
    ]
    symmetric = torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)
    largest = torch.linalg.eigh(symmetric).eigenvectors[..., -1]
    upright = torch.where(largest[..., :1] < 0, -largest, largest)
    return upright.to(rotation.dtype)
