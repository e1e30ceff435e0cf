"""What moves: a window's base features laid over each other, compared over time, read by point."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn

from lidaraccum.model.kabsch import exactly
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.unet import UNet, linear

_TIMES = 3
_POINT_PLACE = 4
_MOMENTS = 4
_TYPICAL_S = 0.4
_HARDLY_TAKEN = 0.1
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
    3 x 3 ones over space, which costs a third of 3 x 3 x 3; the maximum over time takes any T.
    Beside the maximum goes when each place was taken by something movable: the slope of that time
    over the ground is how slowly and which way it went, across any number of cells.

    Source: the paper, section 3.3; the times are ours.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        channels = settings.temporal_channels
        self.halve = nn.Conv2d(settings.base_widths[0], channels, 2, stride=2)
        nn.init.kaiming_normal_(self.halve.weight, nonlinearity="relu")
        self.clock = nn.Linear(_TIMES, channels)
        self.blocks = nn.ModuleList(
            _TemporalBlock(channels) for _ in range(settings.temporal_blocks)
        )
        self.unet = UNet(channels + _MOMENTS, settings.motion_widths)

    def forward(
        self,
        base: torch.Tensor,
        presence: torch.Tensor,
        target_from_frame: torch.Tensor,
        windows: Windows,
        stamps: tuple[float, ...],
        half_extent_m: float,
    ) -> torch.Tensor:
        """Features of W windows.

        Args:
            base: (F, C, S, S) base features, each in its own level coordinates.
            presence: (F, 1, S, S) 0..1: how likely something movable was met there.
            target_from_frame: (F, 4, 4) between level coordinates.
            windows: Which frames belong together.
            stamps: Seconds of the F frames.
            half_extent_m: Half the side of the grid, metres.
        """
        both = torch.cat([base, presence.to(base.dtype)], dim=1)
        warped = warp(both, target_from_frame, windows, half_extent_m)
        times = _times(windows, stamps, base.device)
        stack = torch.relu(self.halve(warped[:, :-1]) + self.clock(times)[:, :, None, None])
        before, after = _neighbours(windows, base.device)
        for block in self.blocks:
            stack = block(stack, before, after)
        lengths = list(windows.lengths)
        taken = nn.functional.max_pool2d(warped[:, -1:].float(), 2)[:, 0]
        parts = zip(
            torch.split(stack, lengths),
            torch.split(taken, lengths),
            torch.split(times, lengths),
            strict=True,
        )
        maps = [
            torch.cat([part.amax(dim=0), moments(own, when).to(part.dtype)])
            for part, own, when in parts
        ]
        return self.unet(torch.stack(maps).contiguous(memory_format=torch.channels_last))


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


class _TemporalBlock(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.space = nn.Conv2d(channels, channels, 3, padding=1)
        self.time = nn.Conv2d(3 * channels, channels, 1)

    def forward(
        self, stack: torch.Tensor, before: torch.Tensor, after: torch.Tensor
    ) -> torch.Tensor:
        own = torch.relu(self.space(stack))
        # One map of zeros at the end stands for the frame before the first and after the last.
        padded = torch.cat([own, torch.zeros_like(own[:1])])
        three = torch.cat([padded[before], own, padded[after]], dim=1)
        return stack + torch.relu(self.time(three))


def _neighbours(windows: Windows, device: torch.device) -> tuple[torch.Tensor, torch.Tensor]:
    """Index (F,) of the frame before and after within the window; F where there is none."""
    owner = windows.of_frame
    count = len(owner)
    before = [i - 1 if i > 0 and owner[i - 1] == owner[i] else count for i in range(count)]
    after = [i + 1 if i + 1 < count and owner[i + 1] == owner[i] else count for i in range(count)]
    return torch.tensor(before, device=device), torch.tensor(after, device=device)


def _times(windows: Windows, stamps: tuple[float, ...], device: torch.device) -> torch.Tensor:
    """(F, 3): seconds from the target, their size, whether it is the target."""
    gaps = torch.tensor(windows.gaps(stamps), dtype=torch.float32, device=device)
    is_target = [index == target for index, target in enumerate(windows.target_of_frame)]
    flag = torch.tensor(is_target, dtype=torch.float32, device=device)
    return torch.stack([gaps, gaps.abs(), flag], dim=1)


def warp(
    base: torch.Tensor, target_from_frame: torch.Tensor, windows: Windows, half_extent_m: float
) -> torch.Tensor:
    """Base features (F, C, S, S) of each frame, read where the target's cells lie in that frame.

    The target's own features stay as they are. Cells are taken to lie on the ground's plane.
    """
    sources = windows.sources
    if not sources:
        return base
    index = torch.tensor(sources, device=base.device)
    with exactly(base):
        grid = _sampling_grid(target_from_frame[index].float(), base.shape[2], half_extent_m)
        moved = nn.functional.grid_sample(
            base[index].float(), grid, mode="bilinear", padding_mode="zeros", align_corners=False
        )
    return base.index_copy(0, index, moved.to(base.dtype))


def _sampling_grid(
    target_from_frame: torch.Tensor, size: int, half_extent_m: float
) -> torch.Tensor:
    """(K, S, S, 2) where in each frame the target's cell centres lie, -1..1, y before x."""
    rotation, shift = target_from_frame[:, :3, :3], target_from_frame[:, :3, 3:]
    back = rotation.transpose(1, 2)
    offset = -(back @ shift)[:, :2, 0] / half_extent_m
    centres = (torch.arange(size, device=shift.device) + 0.5) * (2.0 / size) - 1.0
    x, y = centres[None, :, None], centres[None, None, :]
    turn = back[:, :2, :2, None, None]
    x_there = turn[:, 0, 0] * x + turn[:, 0, 1] * y + offset[:, 0, None, None]
    y_there = turn[:, 1, 0] * x + turn[:, 1, 1] * y + offset[:, 1, None, None]
    return torch.stack([y_there, x_there], dim=-1)


def read(
    maps: torch.Tensor, index: torch.Tensor, xy: torch.Tensor, half_extent_m: float
) -> torch.Tensor:
    """Bilinear reading (Q, C) of maps (N, C, H, H) at points: map index (Q,), x and y (Q, 2).

    Outside the grid the nearest cell at its edge is read.
    """
    size = maps.shape[2]
    cell = ((xy / half_extent_m + 1.0) * (0.5 * size) - 0.5).clamp(0.0, size - 1.0)
    low = cell.floor().clamp_max(size - 2.0)
    part = (cell - low).to(maps.dtype)
    corner = low.long()
    flat = (index * size + corner[:, 0]) * size + corner[:, 1]
    rows = maps.permute(0, 2, 3, 1).reshape(-1, maps.shape[1])
    px, py = part[:, :1], part[:, 1:]
    near = rows.index_select(0, flat) * (1 - py) + rows.index_select(0, flat + 1) * py
    far = rows.index_select(0, flat + size) * (1 - py) + rows.index_select(0, flat + size + 1) * py
    return near * (1 - px) + far * px


class PointHead(nn.Module):
    """A point's motion features, and what they say: foreground, dynamic, offset.

    Source: the paper, equations 3 and 4. Ours: its own frame's base features are read too, the
    foreground is judged once more with the whole window in view, and an offset is the way to the
    centre of the object where the point is, plus a velocity times the time to the target.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        channels = settings.point_channels
        self.place = nn.Sequential(linear(_POINT_PLACE, 32), nn.ReLU(), linear(32, 64))
        read_channels = settings.motion_widths[0] + settings.base_widths[0]
        self.mix = nn.Sequential(
            linear(read_channels + 64, channels),
            nn.ReLU(),
            linear(channels, channels),
            nn.ReLU(),
        )
        self.foreground = nn.Linear(channels, 1)
        self.dynamic = nn.Linear(channels, 1)
        self.offset = nn.Sequential(linear(channels, 64), nn.ReLU(), nn.Linear(64, 4))

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
