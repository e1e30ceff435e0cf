"""Which points go into the output, when not all are asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.accumulation import MOVING, AccumulatedFrame
from lidaraccum.data.frame import BoolArray
from lidaraccum.errors import SettingsError

TILE_VOXELS = 1 << 8
_AXIS_BITS = 21


@dataclass(frozen=True)
class SelectionSettings:
    """What to leave out of the cloud; by default nothing.

    Attributes:
        voxel_m: Keep the first point in each cube of this edge, metres; 0 keeps all.
        crop_m: (xmin, ymin, xmax, ymax) or (xmin, ymin, zmin, xmax, ymax, zmax) in the reference
            frame, metres; empty for no crop.
        min_range_m: Leave out points nearer to the sensor than this.
        max_range_m: Leave out points farther from the sensor than this; 0 for no limit.
        drop_dynamic: Leave out moving points: the clean map.
    """

    voxel_m: float = 0.0
    crop_m: tuple[float, ...] = ()
    min_range_m: float = 0.0
    max_range_m: float = 0.0
    drop_dynamic: bool = False

    def __post_init__(self) -> None:
        lengths = (self.voxel_m, self.min_range_m, self.max_range_m, *self.crop_m)
        if not np.isfinite(lengths).all():
            raise SettingsError("voxel size, ranges and crop must be finite numbers")
        if len(self.crop_m) not in (0, 4, 6):
            raise SettingsError(
                f"a crop is 4 or 6 numbers, not {len(self.crop_m)}",
                hint="xmin,ymin,xmax,ymax or xmin,ymin,zmin,xmax,ymax,zmax",
            )
        half = len(self.crop_m) // 2
        if any(
            low >= high for low, high in zip(self.crop_m[:half], self.crop_m[half:], strict=True)
        ):
            raise SettingsError("a crop's lower corner must lie below its upper corner")
        if min(self.voxel_m, self.min_range_m, self.max_range_m) < 0:
            raise SettingsError("voxel size and ranges must not be negative")
        if self.max_range_m and self.max_range_m <= self.min_range_m:
            raise SettingsError("the largest range must be above the smallest")


class Selection:
    """Applies the settings frame by frame, remembering which voxels are taken."""

    def __init__(self, settings: SelectionSettings) -> None:
        self._settings = settings
        self._voxels = VoxelFilter(settings.voxel_m) if settings.voxel_m else None

    def __call__(self, frame: AccumulatedFrame) -> AccumulatedFrame:
        """The frame's points that are wanted."""
        settings = self._settings
        keep = frame.range_m >= settings.min_range_m
        if settings.max_range_m:
            keep &= frame.range_m <= settings.max_range_m
        if settings.crop_m:
            keep &= _inside(frame.points, settings.crop_m)
        if settings.drop_dynamic:
            keep &= frame.label != MOVING
        wanted = frame.select(keep)
        if self._voxels is None:
            return wanted
        movers = np.where(wanted.label == MOVING, wanted.instance, 0)
        return wanted.select(self._voxels.first(wanted.points, movers))


class VoxelFilter:
    """Keeps the first point in each voxel of a stream.

    Taken voxels are kept as sorted keys by tile, so that a frame touches only the tiles it sees
    and memory grows with the surface mapped, not with the frames.
    """

    def __init__(self, edge_m: float) -> None:
        self._edge_m = edge_m
        self._taken: dict[tuple[int, int, int], NDArray[np.int64]] = {}

    def first(self, points: NDArray[np.float64], group: NDArray[np.int32]) -> BoolArray:
        """(M,) bool: the point is the first of its group in its voxel, over all calls so far."""
        cell = np.floor(points / self._edge_m).astype(np.int64)
        tile = cell[:, :2] // TILE_VOXELS
        within = cell[:, :2] % TILE_VOXELS
        # The tile holds x and y; z may be anything within +- 2^20 voxels.
        key = (within[:, 0] * TILE_VOXELS + within[:, 1]) << _AXIS_BITS
        key += cell[:, 2] + (1 << (_AXIS_BITS - 1))
        keep = np.zeros(len(points), dtype=bool)
        home = np.column_stack([tile, group])
        order = np.lexsort(home.T)
        starts = np.flatnonzero(np.any(np.diff(home[order], axis=0) != 0, axis=1)) + 1
        for members in np.split(order, starts) if len(order) else []:
            rows = np.sort(members)
            keys, first = np.unique(key[rows], return_index=True)
            name = (int(tile[rows[0], 0]), int(tile[rows[0], 1]), int(group[rows[0]]))
            taken = self._taken.get(name, np.empty(0, dtype=np.int64))
            fresh = ~np.isin(keys, taken, assume_unique=True)
            keep[rows[first[fresh]]] = True
            self._taken[name] = np.union1d(taken, keys[fresh])
        return keep


def _inside(points: NDArray[np.float64], crop_m: tuple[float, ...]) -> BoolArray:
    axes = len(crop_m) // 2
    low, high = np.array(crop_m[:axes]), np.array(crop_m[axes:])
    return np.all((points[:, :axes] >= low) & (points[:, :axes] <= high), axis=1)
