"""What the frames of a window say of each place, put together over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce

import torch
from torch import nn

from lidaraccum.model.convolution import Convolution

MOMENTS = 4
_HARDLY_TAKEN = 0.1
_TYPICAL_S = 0.4
"""Times are said in this measure."""


class TemporalBlock(nn.Module):
    """Mixes space, then time: each frame with its neighbours."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.space = Convolution(channels, channels, 3, padding=1)
        self.time = nn.Conv2d(3 * channels, channels, 1)

    def forward(self, stack: Sequence[torch.Tensor]) -> list[torch.Tensor]:
        """Mix the frames of one window, each (1, C, H, H), in order of time."""
        own = [torch.relu_(self.space(one)) for one in stack]
        rows = [cells_of(one) for one in own]
        # As a convolution of three frames side by side, but they are never copied side by side.
        weights = self.time.weight[:, :, 0, 0].to(rows[0].dtype)
        before, now, after = torch.split(weights, len(weights), dim=1)
        mixed = []
        for place, one in enumerate(stack):
            cells = nn.functional.linear(rows[place], now, self.time.bias)
            if place > 0:
                cells.addmm_(rows[place - 1], before.T)
            if place + 1 < len(stack):
                cells.addmm_(rows[place + 1], after.T)
            cells = torch.relu_(cells) + cells_of(one)
            mixed.append(cells.view(1, *one.shape[2:], -1).permute(0, 3, 1, 2))
        return mixed


class Maximum(nn.Module):
    """The largest of what the frames say. Source: the paper, section 3.3."""

    def __init__(self, channels: int) -> None:
        super().__init__()

    def forward(self, stack: Sequence[torch.Tensor], times: torch.Tensor) -> torch.Tensor:
        """(1, C, H, H) of T maps of that shape; their times (T, 3) do not matter."""
        return reduce(torch.maximum, stack)


class DecayedDifferences(nn.Module):
    """What the target says, and how the others differ: those near in time count for more.

    The mean of the differences is weighted by exp(-|t| / decay), whose decay is learned.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.log_decay = nn.Parameter(torch.tensor(math.log(_TYPICAL_S)))
        self.mix = nn.Conv2d(2 * channels, channels, 1)

    def forward(self, stack: Sequence[torch.Tensor], times: torch.Tensor) -> torch.Tensor:
        """(1, C, H, H) of T maps of that shape at times (T, 3), as in `moments`."""
        target = stack[int(times[:, 2].argmax())]
        weights = torch.exp(-times[:, 1] / self.log_decay.exp()) * (1.0 - times[:, 2])
        shares = (weights / weights.sum().clamp_min(1e-6)).to(target.dtype)
        differences = torch.zeros_like(target)
        for share, one in zip(shares, stack, strict=True):
            differences = differences + share * (one - target)
        mixed: torch.Tensor = self.mix(torch.cat([target, differences], dim=1))
        return torch.relu(mixed)


MERGES: dict[str, type[Maximum] | type[DecayedDifferences]] = {
    "max": Maximum,
    "decay": DecayedDifferences,
}
"""Ways to put frames together over time, by `NetworkSettings.temporal`."""


def moments(taken: torch.Tensor, times: torch.Tensor) -> torch.Tensor:
    """(4, H, H): how often places were taken, when on average, spread how far, and at the target.

    Args:
        taken: (T, H, H) 0..1.
        times: (T, 3): seconds from the target, their size, 1 for the target.
    """
    when = (times[:, 0] / _TYPICAL_S)[:, None, None]
    total = taken.sum(dim=0) + _HARDLY_TAKEN
    mean = (taken * when).sum(dim=0) / total
    spread = ((taken * (when - mean) ** 2).sum(dim=0) / total).sqrt()
    at_target = (taken * times[:, 2, None, None]).sum(dim=0)
    return torch.stack([taken.mean(dim=0), mean, spread, at_target])


def cells_of(one: torch.Tensor) -> torch.Tensor:
    """Cells (H * H, C) of a map (1, C, H, H): a view where channels are last in memory."""
    return one.permute(0, 2, 3, 1).reshape(-1, one.shape[1])
