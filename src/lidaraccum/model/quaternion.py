"""Rotations as quaternions, w x y z."""

from __future__ import annotations

import torch
from torch import nn


def rotation_of(quaternion: torch.Tensor) -> torch.Tensor:
    """Rotation (..., 3, 3) of a quaternion (..., 4), w x y z, of any length but 0."""
    w, x, y, z = nn.functional.normalize(quaternion, dim=-1).unbind(-1)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)


def about_vertical(angle: torch.Tensor) -> torch.Tensor:
    """Quaternion (..., 4), w x y z, of turns (...,) about z, radians."""
    none = torch.zeros_like(angle)
    return torch.stack([torch.cos(0.5 * angle), none, none, torch.sin(0.5 * angle)], dim=-1)


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
