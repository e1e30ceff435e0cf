"""A small two-dimensional U-Net: skips are added, not stacked; normalised once, at its end."""

from __future__ import annotations

from itertools import pairwise
from typing import cast

import torch
from torch import nn

from lidaraccum.model.convolution import Convolution

FAINT = 0.01
"""Variance below which a cell is empty rather than faint, and is not blown up."""


def convolution(inputs: int, outputs: int, stride: int = 1) -> Convolution:
    """A 3 x 3 convolution that keeps the size (or halves it), started for a ReLU after it."""
    layer = Convolution(inputs, outputs, 3, stride=stride, padding=1)
    nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
    nn.init.constant_(cast("torch.Tensor", layer.bias), 0.0)
    return layer


def linear(inputs: int, outputs: int) -> nn.Linear:
    """A layer started for a ReLU after it: signals keep their size through many of them."""
    layer = nn.Linear(inputs, outputs)
    nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
    nn.init.zeros_(layer.bias)
    return layer


def deciding(inputs: int, outputs: int) -> nn.Sequential:
    """Two layers whose answers are close to 0 at first, whatever they are told."""
    last = nn.Linear(32, outputs)
    nn.init.normal_(last.weight, std=1e-3)
    nn.init.zeros_(last.bias)
    return nn.Sequential(nn.Linear(inputs, 32), nn.ReLU(inplace=True), last)


def to_one_channel(layer: nn.Conv2d, maps: torch.Tensor) -> torch.Tensor:
    """What a 3 x 3 convolution to one channel makes of maps (N, C, H, W): (N, H, W).

    A product for all nine taps at once, then nine shifted sums of single channels: twice as fast on
    processors as the convolution, which keeps a whole vector busy with one channel.
    """
    count, _, height, width = maps.shape
    taps = nn.functional.linear(maps.permute(0, 2, 3, 1), layer.weight[0].flatten(1).T)
    taps = nn.functional.pad(taps, (0, 0, 1, 1, 1, 1))
    summed = cast("torch.Tensor", layer.bias).expand(count, height, width)
    for tap in range(9):
        down, right = divmod(tap, 3)
        summed = summed + taps[:, down : down + height, right : right + width, tap]
    return summed


def channels_last(module: nn.Module) -> None:
    """Lay out all convolutions as processors like them; numbers stay the same."""
    for parameter in module.parameters():
        if parameter.dim() == 4:
            parameter.data = parameter.data.contiguous(memory_format=torch.channels_last)


class _Down(nn.Module):
    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.halve = convolution(inputs, outputs, stride=2)
        self.refine = convolution(outputs, outputs)

    def forward(self, fine: torch.Tensor) -> torch.Tensor:
        coarse = torch.relu_(self.halve(fine))
        return torch.relu_(self.refine(coarse).add_(coarse))


class _Up(nn.Module):
    def __init__(self, coarse: int, fine: int) -> None:
        super().__init__()
        self.narrow = nn.Conv2d(coarse, fine, 1)
        self.refine = convolution(fine, fine)

    def forward(self, coarse: torch.Tensor, skipped: torch.Tensor) -> torch.Tensor:
        wide = nn.functional.interpolate(self.narrow(coarse), scale_factor=2.0, mode="nearest")
        return self.refine(torch.relu_(wide.add_(skipped)))

    def hand_through(self) -> None:
        """Make it hand on what it is given at its own level, and nothing of the coarser one."""
        for layer in (self.narrow, self.refine):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(cast("torch.Tensor", layer.bias))
        nn.init.dirac_(self.refine.weight)


class UNet(nn.Module):
    """Maps (N, C, H, W) to (N, widths[0], H, W); H and W are multiples of 2^(levels - 1).

    The features of each cell are normalised over their channels, so that every head starts from
    signals of size 1 however much of the map is empty.

    Source: the paper's supplement, figure "Network"; sums for stacks and fewer channels for the
    sake of processors; the normalisation is ours.
    """

    def __init__(self, inputs: int, widths: tuple[int, ...]) -> None:
        super().__init__()
        self.stem = convolution(inputs, widths[0])
        pairs = list(pairwise(widths))
        self.downs = nn.ModuleList(_Down(fine, coarse) for fine, coarse in pairs)
        self.ups = nn.ModuleList(_Up(coarse, fine) for fine, coarse in reversed(pairs))
        self.normalise = nn.LayerNorm(widths[0], eps=FAINT)

    def forward(self, maps: torch.Tensor) -> torch.Tensor:
        """Features at the resolution of the maps.

        Sums and ReLUs are in place, as elsewhere: fresh memory costs more than they do.
        """
        level = torch.relu_(self.stem(maps))
        skipped: list[torch.Tensor] = []
        for down in self.downs:
            skipped.append(level)
            level = down(level)
        for up in self.ups:
            level = up(level, skipped.pop())
        cells: torch.Tensor = self.normalise(level.permute(0, 2, 3, 1))
        return cells.to(level.dtype).permute(0, 3, 1, 2)

    def go_on_from(self, before: UNet) -> None:
        """Take over what a U-Net of fewer levels has learned; those below say nothing yet."""
        added = len(self.downs) - len(before.downs)
        pairs = [
            (self.stem, before.stem),
            (self.normalise, before.normalise),
            *zip(self.downs, before.downs, strict=False),
            *zip(list(self.ups)[added:], before.ups, strict=True),
        ]
        for new, old in pairs:
            new.load_state_dict(old.state_dict())
        for up in list(self.ups)[:added]:
            cast("_Up", up).hand_through()
