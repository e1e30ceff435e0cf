"""The motion that takes places to partners, each of which is known better one way than another."""

from __future__ import annotations

import torch

from lidaraccum.model.kabsch import compose, cross_matrix, exactly, move
from lidaraccum.model.sinkhorn import SoftMatches

SURE_M = 0.1
"""No partner is known better than this, one sigma."""
_BREATH = 1e-3


def spread(matches: SoftMatches, target: torch.Tensor, mass: torch.Tensor) -> torch.Tensor:
    """(B, N, 3, 3) float64, square metres: how what rows are matched with lies about its mean.

    Args:
        matches: (B, N, M).
        target: (B, M, 3) metres, where the columns lie.
        mass: (B, N) of the rows.
    """
    exact = matches.double()  # variances of centimetres of places tens of metres apart
    arms = (target - target.mean(dim=1, keepdim=True)).double()
    squares = (arms[..., :, None] * arms[..., None, :]).flatten(2)
    carried = exact.carry(torch.cat([arms, squares], dim=2))
    carried = carried / mass.double().clamp_min(1e-6)[..., None]
    mean = carried[..., :3]
    return carried[..., 3:].view(*mass.shape, 3, 3) - mean[..., :, None] * mean[..., None, :]


def drawn_to(
    motion: torch.Tensor,
    source: torch.Tensor,
    partner: torch.Tensor,
    covariance: torch.Tensor,
    mass: torch.Tensor,
) -> torch.Tensor:
    """Motions (B, 4, 4) after one step of Gauss and Newton towards partners.

    A partner that was told by places along a wall says little of the way along it.

    Args:
        motion: (B, 4, 4) so far.
        source: (B, N, 3) metres.
        partner: (B, N, 3) metres.
        covariance: (B, N, 3, 3) square metres, of the partners.
        mass: (B, N): how much each counts.

    Source: generalised ICP (Segal et al., RSS 2009), partners and covariances from soft matches.
    """
    with exactly(motion):
        placed = move(motion, source).double()
        centre = placed.mean(dim=1, keepdim=True)
        identity = torch.eye(3, dtype=placed.dtype, device=placed.device)
        known = torch.linalg.inv(covariance.double() + SURE_M**2 * identity)
        turned = -cross_matrix(placed - centre)
        ways = torch.cat([turned, identity.expand_as(turned)], dim=3)  # (B, N, 3, 6)
        pulled = ways.transpose(2, 3) @ known * mass.double()[..., None, None]
        normal = (pulled @ ways).sum(dim=1)
        breath = _BREATH * mass.double().sum(dim=1).clamp_min(1e-6)[:, None, None]
        normal = normal + breath * torch.eye(6, dtype=placed.dtype, device=placed.device)
        missing = (pulled @ (partner - placed)[..., None]).sum(dim=1)
        answer = torch.linalg.solve(normal, missing)[..., 0]
        turn = torch.linalg.matrix_exp(cross_matrix(answer[:, :3]))
        middle = centre[:, 0]
        shift = middle + answer[:, 3:] - (turn @ middle[..., None])[..., 0]
        return (compose(turn, shift) @ motion.double()).to(motion.dtype)
