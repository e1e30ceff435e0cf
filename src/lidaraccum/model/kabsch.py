"""Weighted Kabsch with a gradient that survives symmetric clouds."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

import torch

_SMALLEST_SUM = 1e-6


class _NearestRotation(torch.autograd.Function):
    """The rotation R (B, 3, 3) that maximises trace(R^T M) for M (B, 3, 3).

    Its derivative holds sums of singular values only, where the derivative of the decomposition
    itself holds their differences and is infinite when two are equal.
    """

    @staticmethod
    def forward(ctx: Any, moment: torch.Tensor) -> torch.Tensor:
        left, spread, right = torch.linalg.svd(moment)
        proper = torch.ones_like(spread)
        proper[:, 2] = torch.sign(torch.linalg.det(left @ right))
        rotation = (left * proper[:, None, :]) @ right
        ctx.save_for_backward(rotation, right, spread * proper)
        return rotation

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> torch.Tensor:
        rotation, right, signed = ctx.saved_tensors
        # R^T dM - dM^T R = A P + P A with A = R^T dR antisymmetric and P = R^T M symmetric, whose
        # eigenvectors are the rows of `right`: solved for A by one division in that basis.
        basis = right.transpose(1, 2)
        inner = right @ rotation.transpose(1, 2) @ gradients[0] @ basis
        sums = signed[:, :, None] + signed[:, None, :]
        solved = inner / sums.clamp_min(_SMALLEST_SUM)
        return rotation @ basis @ (solved - solved.transpose(1, 2)) @ right


def nearest_rotation(moment: torch.Tensor) -> torch.Tensor:
    """The rotations (B, 3, 3) nearest to the matrices (B, 3, 3), differentiable once."""
    rotation: torch.Tensor = _NearestRotation.apply(moment)  # type: ignore[no-untyped-call]
    return rotation


def fit_rigid(source: torch.Tensor, target: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """The rigid motions target_from_source (B, 4, 4) that best take weighted points to others.

    Args:
        source: (B, N, 3) metres.
        target: (B, N, 3) metres.
        weight: (B, N), 0 or more; without any weight the answer is to stand still.

    Source: Kabsch (1976); the paper, section 3.2.
    """
    share = weight / (weight.sum(dim=1, keepdim=True) + 1e-6)
    source_mean = (share[..., None] * source).sum(dim=1, keepdim=True)
    target_mean = (share[..., None] * target).sum(dim=1, keepdim=True)
    arms = share[..., None] * (target - target_mean)
    moment = arms.transpose(1, 2) @ (source - source_mean)
    # A breath of the identity decides what no point does.
    identity = torch.eye(3, dtype=moment.dtype, device=moment.device)
    rotation = nearest_rotation(moment + 1e-6 * identity)
    shift = target_mean[:, 0] - (rotation @ source_mean.transpose(1, 2))[..., 0]
    return compose(rotation, shift)


def compose(rotation: torch.Tensor, shift: torch.Tensor) -> torch.Tensor:
    """Motions (..., 4, 4) of rotations (..., 3, 3) and shifts (..., 3)."""
    upper = torch.cat([rotation, shift[..., None]], dim=-1)
    lower = torch.zeros_like(upper[..., :1, :])
    lower[..., 0, 3] = 1.0
    return torch.cat([upper, lower], dim=-2)


def invert(motion: torch.Tensor) -> torch.Tensor:
    """The motions back, of rigid motions (..., 4, 4)."""
    with exactly(motion):
        back = motion[..., :3, :3].transpose(-1, -2)
        return compose(back, -(back @ motion[..., :3, 3:])[..., 0])


def chain(*motions: torch.Tensor) -> torch.Tensor:
    """Motions (..., 4, 4) one after another, the last one first, as matrices are written."""
    with exactly(motions[0]):
        product = motions[0]
        for motion in motions[1:]:
            product = product @ motion
        return product


def move(motion: torch.Tensor, points: torch.Tensor) -> torch.Tensor:
    """Points (..., N, 3) moved by motions (..., 4, 4)."""
    with exactly(points):
        return points @ motion[..., :3, :3].transpose(-1, -2) + motion[..., None, :3, 3]


def about(motion: torch.Tensor, centre: torch.Tensor) -> torch.Tensor:
    """Motions (..., 4, 4) in coordinates whose origin is at ``centre`` (..., 3).

    With ``-centre``, from such coordinates back to those the centre is given in.
    """
    with exactly(motion):
        rotation = motion[..., :3, :3]
        shift = motion[..., :3, 3] + (rotation @ centre[..., None])[..., 0] - centre
        return compose(rotation, shift)


def cross_matrix(vectors: torch.Tensor) -> torch.Tensor:
    """(..., 3, 3): the matrices that cross these vectors (..., 3) with what they multiply."""
    x, y, z = vectors.unbind(dim=-1)
    zero = torch.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)


def exactly(tensor: torch.Tensor) -> AbstractContextManager[object]:
    """Motions are computed as they are given, whatever the precision around: 8 bits lose metres."""
    return torch.autocast(tensor.device.type, enabled=False)
