"""How high a frame lies above another's ground, and how level: the rest of the motion stays."""

from __future__ import annotations

import torch

from lidaraccum.model.kabsch import compose, cross_matrix, exactly, move

CELL_M = 0.5
_CELLS = 512
GATES_M = (0.5, 0.2)
"""Ground further above or below the other's is none of it, or is not seen well: round by round."""
_FEWEST = 50
_BREATH = 1e-3


def levelled(
    motion: torch.Tensor,
    source: torch.Tensor,
    seen: torch.Tensor,
    target: torch.Tensor,
    known: torch.Tensor,
) -> torch.Tensor:
    """Motions (B, 4, 4), level coordinates, so that the ground of source lies on that of target.

    Changed in height, roll and pitch only, by least squares over the ground's heights, robust
    (Tukey's biweight); as they are where fewer than 50 places are seen in both.

    Args:
        motion: (B, 4, 4) target_from_source.
        source: (B, G, 3) metres, pillars of the ground.
        seen: (B, G) bool: which of them are any.
        target: (B, G, 3) and
        known: (B, G) bool: the same of the target.
    """
    with exactly(motion):
        height, count = _height_map(target, known)
        for gate in GATES_M:
            placed = move(motion, source)
            cell, inside = _cells(placed)
            found = count.gather(1, cell)
            rise = height.gather(1, cell) / found.clamp_min(1.0) - placed[..., 2]
            weight = (1.0 - (rise / gate) ** 2).clamp_min(0.0) ** 2
            weight = weight * (seen & inside & (found > 0))
            motion = _step(placed, rise, weight) @ motion
        return motion


def _step(placed: torch.Tensor, rise: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """(B, 4, 4): up, roll and pitch that lift points (B, G, 3) by their rise (B, G), weighted."""
    arms = torch.stack([torch.ones_like(rise), placed[..., 1], -placed[..., 0]], dim=2).double()
    pulled = arms * weight[..., None]
    identity = torch.eye(3, dtype=arms.dtype, device=arms.device)
    normal = pulled.transpose(1, 2) @ arms + _BREATH * identity
    aim = (pulled * rise[..., None]).sum(dim=1)
    up, roll, pitch = torch.linalg.solve(normal, aim).unbind(dim=1)
    zero = torch.zeros_like(up)
    turn = torch.linalg.matrix_exp(cross_matrix(torch.stack([roll, pitch, zero], dim=1)))
    step = compose(turn, torch.stack([zero, zero, up], dim=1)).float()
    enough = (weight > 0).sum(dim=1) >= _FEWEST
    return torch.where(enough[:, None, None], step, torch.eye(4, device=step.device))


def _height_map(ground: torch.Tensor, known: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Sums of heights and counts (B, cells) of ground (B, G, 3) by cell, seen from above."""
    cell, inside = _cells(ground)
    told = (known & inside).float()
    nothing = ground.new_zeros(len(ground), _CELLS * _CELLS)
    heights = nothing.scatter_add(1, cell, ground[..., 2] * told)
    return heights, nothing.scatter_add(1, cell, told)


def _cells(points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Cells (B, G) of points (B, G, 3) in a grid about the origin, and which lie on it."""
    place = torch.floor(points[..., :2] / CELL_M).long() + _CELLS // 2
    inside = ((place >= 0) & (place < _CELLS)).all(dim=2)
    place = place.clamp(0, _CELLS - 1)
    return place[..., 0] * _CELLS + place[..., 1], inside
