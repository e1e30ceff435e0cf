"""The one door between the two array worlds: frames in as tensors, answers out as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.errors import InputError
from lidaraccum.geometry.ground import level_by_ground
from lidaraccum.model.settings import NetworkSettings


@dataclass(frozen=True, eq=False)
class PreparedFrame:
    """One frame levelled, cropped to the grid, sorted by pillar, then by height; still numpy.

    Attributes:
        points: (N, 3) float32, metres, level coordinates: upright, z = 0 on the ground's plane.
        height: (N,) float32, metres above the frame's own ground.
        rows: (N,) int64: each point's row in the frame it came from.
        cell: (N,) int32 ascending: x index times S plus y index of the point's pillar.
        level_from_sensor: (4, 4).
        stamp: Seconds.
        row_count: Points of the frame before the crop.
        cells: S, pillars along one side of the grid.
        pillar_m: Side of a pillar, metres.
    """

    points: NDArray[np.float32]
    height: NDArray[np.float32]
    rows: NDArray[np.int64]
    cell: NDArray[np.int32]
    level_from_sensor: NDArray[np.float64]
    stamp: float
    row_count: int
    cells: int
    pillar_m: float


def prepare(
    frame: Frame, settings: NetworkSettings, extent_m: float | None = None
) -> PreparedFrame:
    """Level a frame by its own ground, keep what the grid covers, sort it by pillar.

    Args:
        frame: Points in sensor coordinates; points that did not return are left out.
        settings: The network's.
        extent_m: Side of the grid, metres; the settings' own when None.

    Raises:
        SettingsError: The extent does not fit the network's levels.
        InputError: No point of the frame lies on the grid.
    """
    extent = settings.extent_m if extent_m is None else extent_m
    cells = settings.cells(extent)
    kept = np.flatnonzero(frame.returned)
    if len(kept) == 0:
        raise InputError(f"frame {frame.name or frame.stamp} has no point that returned")
    # Column by column, and taken rather than picked by brackets: each is several times faster.
    ground, level = level_by_ground(np.asfortranarray(frame.points.take(kept, axis=0)))
    row, column = ((level[:, axis] + 0.5 * extent) / settings.pillar_m for axis in (0, 1))
    inside = np.flatnonzero((row >= 0) & (row < cells) & (column >= 0) & (column < cells))
    cell = row[inside].astype(np.int32) * np.int32(cells) + column[inside].astype(np.int32)
    level = level.T.take(inside, axis=1).T
    height = ground.height_above(level)
    chosen = np.flatnonzero((height > settings.lowest_m) & (height < settings.highest_m))
    if len(chosen) == 0:
        raise InputError(f"frame {frame.name or frame.stamp} has no point within {extent / 2:g} m")
    chosen = chosen[_by_pillar(cell[chosen], height[chosen])]
    return PreparedFrame(
        points=np.ascontiguousarray(level.T.take(chosen, axis=1).T, dtype=np.float32),
        height=height.take(chosen).astype(np.float32),
        rows=kept[inside[chosen]],
        cell=cell[chosen],
        level_from_sensor=ground.level_from_sensor,
        stamp=frame.stamp,
        row_count=len(frame),
        cells=cells,
        pillar_m=settings.pillar_m,
    )


def _by_pillar(cell: NDArray[np.int32], height: NDArray[Any]) -> NDArray[np.int64]:
    """Order (N,) of points by pillar and, within it, by height: one number sorts faster."""
    above = height.astype(np.float64) - height.min()
    return np.argsort(cell * (above.max() + 1.0) + above)


@dataclass(frozen=True, eq=False)
class FrameTensors:
    """F frames on one device: P points in V occupied pillars, sorted by frame, pillar, height.

    Attributes:
        points: (P, 3) float32, metres, level coordinates of the point's own frame.
        height: (P,) float32, metres above ground.
        rows: (P,) int64 row in the frame it came from.
        pillar: (P,) int64 index into the V pillars.
        point_counts: Points of each frame, F numbers.
        pillar_cell: (V,) int64 cell within the frame's own grid, x index times S plus y index.
        pillar_mean: (V, 3) float32 mean of its points, level coordinates.
        pillar_height: (V,) float32 mean height above ground, metres.
        pillar_counts: Pillars of each frame, F numbers.
        level_from_sensor: (F, 4, 4) float32.
        stamps: Seconds, F numbers.
        row_counts: Points of each frame before the crop, F numbers.
        cells: S, pillars along one side of the grid.
        pillar_m: Side of a pillar, metres.
    """

    points: torch.Tensor
    height: torch.Tensor
    rows: torch.Tensor
    pillar: torch.Tensor
    point_counts: tuple[int, ...]
    pillar_cell: torch.Tensor
    pillar_mean: torch.Tensor
    pillar_height: torch.Tensor
    pillar_counts: tuple[int, ...]
    level_from_sensor: torch.Tensor
    stamps: tuple[float, ...]
    row_counts: tuple[int, ...]
    cells: int
    pillar_m: float

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def half_extent_m(self) -> float:
        """Half the side of the grid, metres."""
        return 0.5 * self.cells * self.pillar_m

    @property
    def point_frame(self) -> torch.Tensor:
        """(P,) int64 frame of each point."""
        return _repeat(self.point_counts, self.points.device)

    @property
    def pillar_frame(self) -> torch.Tensor:
        """(V,) int64 frame of each pillar."""
        return _repeat(self.pillar_counts, self.points.device)

    @property
    def pillar_place(self) -> torch.Tensor:
        """(V,) int64 cell of each pillar, counted through the grids of all frames in order."""
        return self.pillar_frame * self.cells * self.cells + self.pillar_cell

    def pillar_centres(self) -> torch.Tensor:
        """(V, 2) x and y of the pillars' centres, metres, level coordinates."""
        index = torch.stack([self.pillar_cell // self.cells, self.pillar_cell % self.cells], dim=1)
        return (index + 0.5) * self.pillar_m - self.half_extent_m

    def select(self, index: int) -> FrameTensors:
        """One of the frames alone."""
        first_point = sum(self.point_counts[:index])
        first_pillar = sum(self.pillar_counts[:index])
        mine = slice(first_point, first_point + self.point_counts[index])
        own = slice(first_pillar, first_pillar + self.pillar_counts[index])
        return FrameTensors(
            points=self.points[mine],
            height=self.height[mine],
            rows=self.rows[mine],
            pillar=self.pillar[mine] - first_pillar,
            point_counts=(self.point_counts[index],),
            pillar_cell=self.pillar_cell[own],
            pillar_mean=self.pillar_mean[own],
            pillar_height=self.pillar_height[own],
            pillar_counts=(self.pillar_counts[index],),
            level_from_sensor=self.level_from_sensor[index : index + 1],
            stamps=(self.stamps[index],),
            row_counts=(self.row_counts[index],),
            cells=self.cells,
            pillar_m=self.pillar_m,
        )

    @staticmethod
    def stack(parts: Sequence[FrameTensors]) -> FrameTensors:
        """Several put one after another; their grids must be the same."""
        pillar_counts = [sum(part.pillar_counts) for part in parts]
        before = np.cumsum([0, *pillar_counts[:-1]]).tolist()
        return FrameTensors(
            points=torch.cat([part.points for part in parts]),
            height=torch.cat([part.height for part in parts]),
            rows=torch.cat([part.rows for part in parts]),
            pillar=torch.cat(
                [part.pillar + offset for part, offset in zip(parts, before, strict=True)]
            ),
            point_counts=tuple(count for part in parts for count in part.point_counts),
            pillar_cell=torch.cat([part.pillar_cell for part in parts]),
            pillar_mean=torch.cat([part.pillar_mean for part in parts]),
            pillar_height=torch.cat([part.pillar_height for part in parts]),
            pillar_counts=tuple(count for part in parts for count in part.pillar_counts),
            level_from_sensor=torch.cat([part.level_from_sensor for part in parts]),
            stamps=tuple(stamp for part in parts for stamp in part.stamps),
            row_counts=tuple(count for part in parts for count in part.row_counts),
            cells=parts[0].cells,
            pillar_m=parts[0].pillar_m,
        )


def _repeat(counts: tuple[int, ...], device: torch.device) -> torch.Tensor:
    repeats = torch.tensor(counts, device=device)
    return torch.repeat_interleave(repeats, output_size=sum(counts))


def to_tensors(frames: Sequence[PreparedFrame], device: torch.device | str = "cpu") -> FrameTensors:
    """Prepared frames, all on one grid, onto a device."""
    return FrameTensors.stack([_to_tensors(frame, torch.device(device)) for frame in frames])


def _to_tensors(frame: PreparedFrame, device: torch.device) -> FrameTensors:
    first = np.flatnonzero(np.diff(frame.cell, prepend=-1))
    counts = np.diff(first, append=len(frame.cell))
    tall = np.concatenate([frame.points, frame.height[:, None]], axis=1, dtype=np.float64)
    mean = (np.add.reduceat(tall, first) / counts[:, None]).astype(np.float32)

    def put(array: NDArray[np.generic]) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(array)).to(device, non_blocking=True)

    return FrameTensors(
        points=put(frame.points),
        height=put(frame.height),
        rows=put(frame.rows),
        pillar=put(np.repeat(np.arange(len(first)), counts)),
        point_counts=(len(frame.cell),),
        pillar_cell=put(frame.cell[first].astype(np.int64)),
        pillar_mean=put(mean[:, :3]),
        pillar_height=put(mean[:, 3]),
        pillar_counts=(len(first),),
        level_from_sensor=put(frame.level_from_sensor.astype(np.float32)[None]),
        stamps=(frame.stamp,),
        row_counts=(frame.row_count,),
        cells=frame.cells,
        pillar_m=frame.pillar_m,
    )


def to_arrays(tensor: torch.Tensor) -> NDArray[np.float64]:
    """A tensor of numbers as a float64 array of its shape, off the device and the graph."""
    return tensor.detach().to("cpu", torch.float64).numpy()


def to_indices(tensor: torch.Tensor) -> NDArray[np.int64]:
    """A tensor of integers as an int64 array of its shape."""
    return tensor.detach().to("cpu", torch.int64).numpy()
