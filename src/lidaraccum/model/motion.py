"""What moves: a window's base features laid over each other, compared over time, read by point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import nn

from lidaraccum.model.kabsch import exactly
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.temporal import MERGES, MOMENTS, TemporalBlock, cells_of, moments
from lidaraccum.model.unet import UNet, linear

_TIMES = 3
_POINT_PLACE = 4
_TYPICAL_MPS = 10.0
"""Velocities and times are said in these measures."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Which of F frames make which window: W windows, one after another, frames in order of time.

    Attributes:
        lengths: Frames of each window, W numbers, together F.
        target: Index of each window's target among the F frames, W numbers.
    """

    lengths: tuple[int, ...]
    target: tuple[int, ...]

    @classmethod
    def single(cls, length: int, target: int = 0) -> Windows:
        """One window."""
        return cls((length,), (target,))

    @property
    def of_frame(self) -> list[int]:
        """Window of each of the F frames."""
        return [window for window, length in enumerate(self.lengths) for _ in range(length)]

    @property
    def target_of_frame(self) -> list[int]:
        """For each frame the index of its window's target."""
        return [self.target[window] for window in self.of_frame]

    @property
    def sources(self) -> list[int]:
        """The frames that are not their window's target, in order."""
        return [frame for frame, target in enumerate(self.target_of_frame) if frame != target]

    def gaps(self, stamps: tuple[float, ...]) -> list[float]:
        """Seconds from the target's stamp to each frame's, F numbers."""
        return [
            stamp - stamps[target]
            for stamp, target in zip(stamps, self.target_of_frame, strict=True)
        ]


class MotionMap(nn.Module):
    """Motion features (W, C', S/2, S/2) of W windows in their targets' level coordinates.

    Base features are warped at full resolution, where a pedestrian's step is still seen, and
    compared at half. Time is mixed by 1 x 1 convolutions over three neighbouring frames between
    3 x 3 ones over space, which costs a third of 3 x 3 x 3; the maximum over time (or
    `NetworkSettings.temporal`) takes any T. Beside it goes when each place was taken by something
    movable: the slope of that time over the ground is how slowly and which way it went, across any
    number of cells.

    Source: the paper, section 3.3; the times are ours.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        channels = settings.temporal_channels
        self.halve = nn.Conv2d(settings.base_widths[0], channels, 2, stride=2)
        nn.init.kaiming_normal_(self.halve.weight, nonlinearity="relu")
        self.clock = nn.Linear(_TIMES, channels)
        self.blocks = nn.ModuleList(
            TemporalBlock(channels) for _ in range(settings.temporal_blocks)
        )
        self.merge = MERGES[settings.temporal](channels)
        self.unet = UNet(channels + MOMENTS, settings.motion_widths)

    def forward(
        self,
        base: Sequence[torch.Tensor],
        presence: torch.Tensor,
        target_from_frame: torch.Tensor,
        windows: Windows,
        stamps: tuple[float, ...],
        half_extent_m: float,
    ) -> torch.Tensor:
        """Features of W windows.

        Frames go one by one until they are compared: together they would fill memory, not time.

        Args:
            base: Of each of F frames (1, C, S, S) base features, in its own level coordinates.
            presence: (F, 1, S, S) 0..1: how likely something movable was met there.
            target_from_frame: (F, 4, 4) between level coordinates.
            windows: Which frames belong together.
            stamps: Seconds of the F frames.
            half_extent_m: Half the side of the grid, metres.
        """
        times = _times(windows, stamps, presence.device)
        there, halved = [], []
        for frame, when in enumerate(times):
            maps = [presence[frame : frame + 1], base[frame]]
            if frame in windows.sources:
                maps = warp(maps, target_from_frame[frame], half_extent_m)
            there.append(maps[0])
            halved.append(self._halve(maps[1], when))
        taken = nn.functional.max_pool2d(torch.cat(there), 2)[:, 0]
        merged, first = [], 0
        for length in windows.lengths:
            own = slice(first, first + length)
            stack = halved[own]
            for block in self.blocks:
                stack = block(stack)
            summary = moments(taken[own], times[own])[None].to(stack[0].dtype)
            merged.append(torch.cat([self.merge(stack, times[own]), summary], dim=1))
            first += length
        return self.unet(torch.cat(merged).contiguous(memory_format=torch.channels_last))

    def _halve(self, base: torch.Tensor, when: torch.Tensor) -> torch.Tensor:
        """(1, C'', S/2, S/2) of warped base features (1, C, S, S), told their time (3,)."""
        bias = self.halve.bias + self.clock(when)
        return torch.relu_(nn.functional.conv2d(base, self.halve.weight, bias, stride=2))


def _times(windows: Windows, stamps: tuple[float, ...], device: torch.device) -> torch.Tensor:
    """(F, 3): seconds from the target, their size, whether it is the target."""
    gaps = torch.tensor(windows.gaps(stamps), dtype=torch.float32, device=device)
    is_target = [index == target for index, target in enumerate(windows.target_of_frame)]
    flag = torch.tensor(is_target, dtype=torch.float32, device=device)
    return torch.stack([gaps, gaps.abs(), flag], dim=1)


def warp(
    maps: Sequence[torch.Tensor], target_from_frame: torch.Tensor, half_extent_m: float
) -> list[torch.Tensor]:
    """Maps (1, C, S, S) of one frame, read where the target's cells lie in that frame.

    Cells are taken to lie on the ground's plane.
    """
    with exactly(maps[0]):
        size = maps[0].shape[2]
        corners = _Corners.about(
            *_cells_there(target_from_frame.float(), size, half_extent_m), size
        )
        return [corners.read(one).view(size, size, -1).permute(2, 0, 1)[None] for one in maps]


def _cells_there(
    target_from_frame: torch.Tensor, size: int, half_extent_m: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Where in the frame the target's cell centres lie, x and y (S * S,) each, in cells."""
    rotation, shift = target_from_frame[:3, :3], target_from_frame[:3, 3:]
    back = rotation.T
    offset = -(back @ shift)[:2, 0] / half_extent_m
    centres = (torch.arange(size, device=shift.device) + 0.5) * (2.0 / size) - 1.0
    x, y = centres[:, None], centres[None, :]
    x_there = back[0, 0] * x + back[0, 1] * y + offset[0]
    y_there = back[1, 0] * x + back[1, 1] * y + offset[1]
    return _to_cells(x_there.view(-1), size), _to_cells(y_there.view(-1), size)


def _to_cells(place: torch.Tensor, size: int) -> torch.Tensor:
    """Places -1..1 over the grid as cells, 0 at the first one's centre."""
    return (place + 1.0) * (0.5 * size) - 0.5


def read(one: torch.Tensor, xy: torch.Tensor, half_extent_m: float) -> torch.Tensor:
    """Bilinear reading (Q, C) of a map (1, C, H, H) at points' x and y (Q, 2), metres.

    Outside the grid the nearest cell at its edge is read.
    """
    size = one.shape[2]
    cells = _to_cells(xy.T / half_extent_m, size).clamp_(0.0, size - 1.0)
    return _Corners.about(cells[0], cells[1], size).read(one)


@dataclass(frozen=True, eq=False)
class _Corners:
    """The four cells about each of Q places on a map of H by H cells.

    Attributes:
        cell: (Q, 4) int32, row by row through the map.
        share: (Q, 4) what each counts in a bilinear reading; 0 outside.
    """

    cell: torch.Tensor
    share: torch.Tensor

    @classmethod
    def about(cls, x: torch.Tensor, y: torch.Tensor, size: int) -> _Corners:
        """Of places x and y (Q,) each, in cells."""
        corners = [
            (row * size + column, share * part)
            for row, share in _neighbours(x, size)
            for column, part in _neighbours(y, size)
        ]
        cells, shares = zip(*corners, strict=True)
        return cls(torch.stack(cells, dim=1), torch.stack(shares, dim=1))

    def read(self, one: torch.Tensor) -> torch.Tensor:
        """Bilinear reading (Q, C) of a map (1, C, H, H).

        A weighted sum of four rows each: several times faster on processors than `grid_sample`,
        for channels lie together in memory.
        """
        rows = cells_of(one).float()
        if rows.shape[1] == 1:
            return (rows[:, 0][self.cell] * self.share).sum(dim=1, keepdim=True).to(one.dtype)
        summed = nn.functional.embedding_bag(
            self.cell, rows, mode="sum", per_sample_weights=self.share
        )
        return summed.to(one.dtype)


def _neighbours(at: torch.Tensor, size: int) -> list[tuple[torch.Tensor, torch.Tensor]]:
    """The two cells (Q,) int32 beside places (Q,) on an axis, and their shares; 0 if outside."""
    low = at.floor()
    part = at - low
    found = []
    for cell, share in ((low, 1.0 - part), (low + 1.0, part)):
        inside = cell.clamp(0.0, size - 1.0)
        found.append((inside.int(), share * (inside == cell)))
    return found


class PointHead(nn.Module):
    """A point's motion features, and what they say: foreground, dynamic, offset.

    Source: the paper, equations 3 and 4. Ours: its own frame's base features are read too, the
    foreground is judged once more with the whole window in view, and an offset is the way to the
    centre of the object where the point is, plus a velocity times the time to the target.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        channels = settings.point_channels
        self.place = nn.Sequential(linear(_POINT_PLACE, 32), nn.ReLU(inplace=True), linear(32, 64))
        read_channels = settings.motion_widths[0] + settings.base_widths[0]
        self.mix = nn.Sequential(
            linear(read_channels + 64, channels),
            nn.ReLU(inplace=True),
            linear(channels, channels),
            nn.ReLU(inplace=True),
        )
        self.foreground = nn.Linear(channels, 1)
        self.dynamic = nn.Linear(channels, 1)
        self.offset = nn.Sequential(linear(channels, 64), nn.ReLU(inplace=True), nn.Linear(64, 4))

    def forward(
        self, motion: torch.Tensor, base: torch.Tensor, place: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        """Features (Q, D), foreground and dynamic logits (Q,), offsets (Q, 2) in metres.

        Args:
            motion: (Q, C') read off the window's motion map.
            base: (Q, C) read off the frame's own base map.
            place: (Q, 4) place in its pillar (2, in pillars), height, seconds from the target.
        """
        feature = self.mix(torch.cat([motion, base, self.place(place).to(motion.dtype)], dim=1))
        centre, velocity = self.offset(feature).float().split(2, dim=1)
        return (
            feature,
            self.foreground(feature)[:, 0].float(),
            self.dynamic(feature)[:, 0].float(),
            centre - place[:, 3:] * (_TYPICAL_MPS * velocity),
        )
