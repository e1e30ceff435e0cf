"""Frames in the order a window is matched, and where steady motion puts the next one."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from lidaraccum.model.kabsch import chain, compose, exactly, invert
from lidaraccum.model.motion import Windows
from lidaraccum.model.quaternion import quaternion_of, rotation_of


def outward(windows: Windows) -> list[list[int]]:
    """The frames that are no targets, nearest to their targets first: next ones, those after."""
    away = [abs(frame - target) for frame, target in enumerate(windows.target_of_frame)]
    return [
        [frame for frame, steps in enumerate(away) if steps == number]
        for number in range(1, max(away, default=0) + 1)
    ]


def steady(
    target_from_frame: torch.Tensor,
    stamps: Sequence[float],
    frames: Sequence[int],
    windows: Windows,
) -> torch.Tensor:
    """Where frames (K) would be if the sensor had gone on as it went between the two before.

    Args:
        target_from_frame: (F, 4, 4) motions known so far; targets have the identity.
        stamps: F numbers, seconds.
        frames: Two frames away from their targets or further.
        windows: Which frames make which window.

    Returns:
        (K, 4, 4) target_from_frame.
    """
    toward = [1 if windows.target_of_frame[frame] > frame else -1 for frame in frames]
    nearer = [frame + step for frame, step in zip(frames, toward, strict=True)]
    before = [frame + step for frame, step in zip(nearer, toward, strict=True)]
    shares = [
        (stamps[frame] - stamps[near]) / ((stamps[near] - stamps[first]) or 1.0)
        for frame, near, first in zip(frames, nearer, before, strict=True)
    ]
    went = chain(invert(target_from_frame[before]), target_from_frame[nearer])
    return chain(target_from_frame[nearer], part_of(went, went.new_tensor(shares)))


def part_of(motion: torch.Tensor, share: torch.Tensor) -> torch.Tensor:
    """Motions (K, 4, 4) made for only so long, or longer, ``share`` (K,): turn and shift scaled."""
    with exactly(motion):
        quaternion = quaternion_of(motion[:, :3, :3])
        length = torch.linalg.vector_norm(quaternion[:, 1:], dim=1, keepdim=True)
        half = share[:, None] * torch.atan2(length, quaternion[:, :1])
        axis = quaternion[:, 1:] / length.clamp_min(1e-12)
        turned = torch.cat([torch.cos(half), torch.sin(half) * axis], dim=1)
        return compose(rotation_of(turned), share[:, None] * motion[:, :3, 3])
