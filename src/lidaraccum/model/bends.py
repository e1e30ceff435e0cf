"""The way of an object that turns steadily, laid straight: it goes as far in every second.

In t seconds an object that goes with velocity v and turns at a rate w gets to
R(w t / 2) v t sin(w t / 2) / (w t / 2): along a chord of its circle, which faces half of its turn.
"""

from __future__ import annotations

import torch

from lidaraccum.model.kabsch import exactly
from lidaraccum.model.quaternion import about_vertical, rotation_of

_LEAST_RAD = 1e-4


def bend_of(rotation: torch.Tensor) -> torch.Tensor:
    """Half of the turn (...,) about the vertical of rotations (..., 3, 3), radians."""
    return 0.5 * torch.atan2(rotation[..., 1, 0], rotation[..., 0, 0])


def unbent(way: torch.Tensor, bend: torch.Tensor) -> torch.Tensor:
    """Ways (..., 3) metres to where turns began, of turns (..., 3, 3), as if none had turned."""
    return _turned(way, bend) / _chord(bend)


def bent(way: torch.Tensor, bend: torch.Tensor) -> torch.Tensor:
    """The inverse of `unbent`."""
    return _turned(way, -bend) * _chord(bend)


def _chord(bend: torch.Tensor) -> torch.Tensor:
    """(..., 3) how long the chord is for the way round: the height is gone as it was."""
    safe = torch.where(bend.abs() < _LEAST_RAD, _LEAST_RAD, bend)
    short = (torch.sin(safe) / safe).clamp_min(0.5)
    return torch.stack([short, short, torch.ones_like(short)], dim=-1)


def _turned(way: torch.Tensor, angle: torch.Tensor) -> torch.Tensor:
    with exactly(way):
        return (rotation_of(about_vertical(angle)) @ way[..., None])[..., 0]
