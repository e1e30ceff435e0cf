"""Points to pillars to a bird's-eye map: a point-wise MLP and a maximum over each pillar."""

from __future__ import annotations

import torch
from torch import nn

from lidaraccum.model.batch import FrameTensors
from lidaraccum.model.pooling import tallest
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.unet import linear

_POINT_FEATURES = 6
_HEIGHT_SCALE_M = 2.0


class PillarEncoder(nn.Module):
    """A map (F, C, S, S) of each frame, zero where there is no point; x by row, y by column.

    A point is told by where it lies in its pillar and how high above the frame's own ground:
    neither absolute x and y nor intensity, which are traits of a sensor, not of a scene.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        self.most = settings.pillar_points
        self.inner = linear(_POINT_FEATURES, settings.point_hidden)
        self.outer = linear(settings.point_hidden, settings.pillar_channels)
        self.normalise = nn.LayerNorm(settings.pillar_channels)
        self.project = nn.Linear(settings.pillar_channels, settings.base_widths[0])

    def forward(self, frames: FrameTensors) -> torch.Tensor:
        """Encode F frames."""
        points, pillar = speakers(frames, self.most)
        told = _point_features(frames, points, pillar)
        hidden = torch.relu_(nn.functional.linear(told, _with_one(self.inner)))
        hidden = nn.functional.linear(hidden, _with_bias(self.outer))  # the maximum holds the ReLU
        pooled = tallest(hidden, pillar, len(frames.pillar_cell))
        pillars = self.project(self.normalise(pooled).to(hidden.dtype))  # (V, C)
        canvas = pillars.new_zeros(len(frames) * frames.cells * frames.cells, pillars.shape[1])
        canvas.index_copy_(0, frames.pillar_place, pillars)
        rows = canvas.view(len(frames), frames.cells, frames.cells, -1)
        return rows.permute(0, 3, 1, 2)  # (F, C, S, S), channels last in memory


def speakers(frames: FrameTensors, most: int) -> tuple[torch.Tensor, torch.Tensor]:
    """The points that tell of their pillars, and whose pillar each tells of, both (Q,) int64.

    The maximum over hundreds of points is taller than that over ten of the same surface: a near
    car, or one under a sensor of more rays, would be another thing to the network.

    Source: PointPillars (Lang et al., CVPR 2019) takes so many at random; here they are every so
    many by height, the lowest and the highest among them.

    Args:
        frames: Sorted by pillar, then by height.
        most: Of a pillar that has more points, so many; 0 for all of them.
    """
    count = torch.bincount(frames.pillar, minlength=len(frames.pillar_cell))
    kept = count.clamp(max=most) if most else count
    places = torch.arange(len(count), device=count.device)
    pillar = torch.repeat_interleave(places, kept)
    turn = torch.arange(len(pillar), device=count.device) - (kept.cumsum(0) - kept)[pillar]
    steps = turn * (count - 1)[pillar] // (kept - 1).clamp(min=1)[pillar]
    return (count.cumsum(0) - count)[pillar] + steps, pillar


def _point_features(
    frames: FrameTensors, points: torch.Tensor, pillar: torch.Tensor
) -> torch.Tensor:
    """(Q, 7): place in the pillar, place against the pillar's mean, height above ground, and 1."""
    home = torch.cat(
        [frames.pillar_centres(), frames.pillar_mean[:, :2], frames.pillar_height[:, None]], dim=1
    ).index_select(0, pillar)
    xy = frames.points[:, :2].index_select(0, points)
    height = frames.height.index_select(0, points)[:, None]
    told = torch.cat([xy, xy, height, height, torch.ones_like(height)], dim=1)
    told[:, :5] -= home
    measures = [frames.pillar_m] * 4 + [_HEIGHT_SCALE_M] * 2 + [1.0]
    return told.div_(told.new_tensor(measures))


def _with_bias(layer: nn.Linear) -> torch.Tensor:
    """Weights (O, I + 1) of a layer that is told 1 beside its inputs.

    To add the bias costs as much as all the rest where rows are many and channels few.
    """
    return torch.cat([layer.weight, layer.bias[:, None]], dim=1)


def _with_one(layer: nn.Linear) -> torch.Tensor:
    """As `_with_bias`, with a row more (O + 1, I + 1) that hands the 1 on."""
    weights = _with_bias(layer)
    one = weights.new_zeros(1, weights.shape[1])
    one[0, -1] = 1.0
    return torch.cat([weights, one])
