"""A sliding local map: space cut into voxels at three sizes, each with the plane of its points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray
from lidaraccum.geometry import planes, rigid, voxel
from lidaraccum.registration.plane_index import Matches, PlaneIndex

FORGETTING = 0.85
"""What an older observation of a voxel still counts when the voxel is seen once more."""

MIN_POINTS = 6.0
"""Points (after forgetting) a voxel needs before its plane is believed."""

MAX_THICKNESS = 0.1
"""A plane's standard deviation may be this share of its voxel's edge."""

MIN_SPREAD = 0.1
"""The plane's points must spread, in their second direction, by this share of the edge: the
points of one beam on a wall are a line, and a line has no normal."""

MIN_FLATNESS = 4.0
"""The plane's second variance must be this many times its smallest."""

SENSOR_NOISE_M = 0.02
"""No plane is believed to be thinner than this."""

FORGET_EVERY = 5
"""Frames between two clearings of the map."""

IDENTITY = np.eye(4)

_MOMENTS, _MEAN, _NORMAL = slice(0, 10), slice(10, 13), slice(13, 16)
_PLANE, _WEIGHT, _SEEN = slice(10, 17), 16, 17
_ROWS = 18


class VoxelLevel:
    """Voxels of one size, each with its points' moments about its centre and their plane.

    What is known of them is one table (18, room for V): moments; mean and unit normal of the
    plane; its weight, 1 where it is as thin as the sensor's noise, 0 where it is not believed; the
    frame that saw it last. All coordinates are the map's, about its origin.
    """

    def __init__(self, size_m: float) -> None:
        self.size_m = size_m
        self._keys = np.zeros(0, dtype=np.int64)
        self._columns = np.zeros(0, dtype=np.int64)
        self._table = np.zeros((_ROWS, 0))

    def __len__(self) -> int:
        return len(self._keys)

    @property
    def means(self) -> NDArray[np.float64]:
        """Means (3, V) of what the voxels saw, metres."""
        return self._table[_MEAN, : len(self)]

    def believed(self) -> tuple[voxel.Keys, NDArray[np.float64]]:
        """Keys (P,) of the voxels with a believable plane, and mean, normal and weight (7, P)."""
        chosen = np.flatnonzero(self._table[_WEIGHT].take(self._columns))
        return self._keys.take(chosen), self._table[_PLANE].take(self._columns[chosen], axis=1)

    def add(self, cells: NDArray[np.int64], moments: NDArray[np.float64], now: int) -> None:
        """Merge voxels, as unique sorted cells (3, V), with their points' moments (10, V)."""
        at = self._columns_of(voxel.cell_keys(cells.T))
        seen = np.zeros((_ROWS, len(at)))
        merged = self._table[_MOMENTS].take(at, axis=1, out=seen[_MOMENTS], mode="clip")
        merged *= FORGETTING
        merged += moments
        mean, covariance = planes.mean_and_covariance(merged)
        seen[_MEAN] = mean + (cells + 0.5) * self.size_m
        enough = np.flatnonzero(merged[0] >= MIN_POINTS)
        normals, variances = planes.plane_normals(covariance.take(enough, axis=1).T)
        seen[_NORMAL, enough], seen[_WEIGHT, enough] = normals.T, self._weights(variances.T)
        seen[_SEEN] = now
        for row, values in zip(self._table, seen, strict=True):
            row[at] = values

    def _weights(self, variances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weights (V,) of planes with variances (3, V), smallest first: 0 for no believable one."""
        least, middle, _ = variances
        is_flat = (
            (least < (MAX_THICKNESS * self.size_m) ** 2)
            & (middle > (MIN_SPREAD * self.size_m) ** 2)
            & (middle > MIN_FLATNESS * least)
        )
        return is_flat * SENSOR_NOISE_M**2 / (SENSOR_NOISE_M**2 + np.maximum(least, 0.0))

    def _columns_of(self, keys: voxel.Keys) -> NDArray[np.int64]:
        """Columns (V,) of the table for unique sorted keys (V,); room is made for new ones."""
        at, known = np.searchsorted(self._keys, keys), len(self)
        is_new = np.append(self._keys, -1).take(at) != keys
        columns = np.append(self._columns, 0).take(at)
        fresh = np.flatnonzero(is_new)
        columns[fresh] = np.arange(known, known + len(fresh))
        self._columns = np.insert(self._columns, at[fresh], columns[fresh])
        self._keys = np.insert(self._keys, at[fresh], keys[fresh])
        if len(self) > self._table.shape[1]:
            self._table = np.concatenate([self._table, np.zeros((_ROWS, len(self)))], axis=1)
        return columns

    def keep(self, wanted: BoolArray) -> None:
        """Forget every voxel but the wanted (V,)."""
        if wanted.all():
            return
        is_kept = wanted.take(self._columns)
        self._keys = self._keys[is_kept]
        self._columns = (np.cumsum(wanted) - 1).take(self._columns[is_kept])
        self._table = self._table.compress(wanted, axis=1)

    @property
    def last_seen(self) -> NDArray[np.float64]:
        """Number (V,) of the frame that saw each voxel last."""
        return self._table[_SEEN, : len(self)]


class SurfaceMap:
    """What the last frames saw around the sensor, in bounded memory.

    It counts from a corner of voxels where it begins: worlds may start thousands of kilometres off.
    """

    def __init__(self, voxel_m: float, radius_m: float, memory_frames: int = 100) -> None:
        self.radius_m = radius_m
        self.memory_frames = memory_frames
        self._origin = np.zeros(3)
        self._levels = tuple(VoxelLevel(voxel_m * factor) for factor in (1, 2, 4))
        self._waiting: list[tuple[NDArray[Any], int, rigid.Pose]] = []
        self._indices: dict[int, PlaneIndex] = {}

    def insert(self, points: NDArray[Any], now: int, pose: rigid.Pose = IDENTITY) -> None:
        """Add one frame's points (N, 3), seen in frame ``now`` from ``pose``, world_from_sensor.

        That is done when the map is next asked: nobody asks after the last frame.
        """
        if len(points) > 0:
            self._waiting.append((points, now, pose))

    def match(self, places: NDArray[np.float64], finest: int = 0) -> Matches:
        """Planes under places (3, N), world coordinates: the finest that is there.

        Args:
            places: (3, N) metres, world.
            finest: Level to begin with: 0 all, 1 without the finest, 2 the coarsest only.
        """
        self._catch_up()
        if finest not in self._indices:
            levels = self._levels[finest:]
            voxels = [level.believed() for level in reversed(levels)]
            self._indices[finest] = PlaneIndex(voxels, levels[-1].size_m, self._origin)
        return self._indices[finest].match(places)

    @property
    def means(self) -> NDArray[np.float64]:
        """Means (3, V) of what the finest voxels saw, metres, world."""
        self._catch_up()
        return self._levels[0].means + self._origin[:, None]

    def _catch_up(self) -> None:
        for points, now, pose in self._waiting:
            self._add(points, now, pose)
            if now % FORGET_EVERY == 0:
                self._forget_far(pose[:3, 3], now)
            self._indices.clear()
        self._waiting.clear()

    def _add(self, points: NDArray[Any], now: int, pose: rigid.Pose) -> None:
        finest, coarsest = self._levels[0].size_m, self._levels[-1].size_m
        # About a corner of the coarsest voxels near the sensor the points keep their precision.
        corner = np.floor(pose[:3, 3] / coarsest) * coarsest
        if not any(len(level) for level in self._levels):
            self._origin = corner
        scaled = _moved(points, pose[:3, :3], pose[:3, 3] - corner) * (1.0 / finest)
        floor = np.floor(scaled)
        order, starts = voxel.group_by_cell(floor)
        within = ((scaled - floor - 0.5) * finest).take(order, axis=1)
        moments = planes.summed_moments(within, starts)
        cells = floor.take(order.take(starts), axis=1).astype(np.int64)
        cells += np.round((corner - self._origin) / finest).astype(np.int64)[:, None]
        for level in self._levels:
            if level is not self._levels[0]:
                cells, moments = _merged(cells, moments, level.size_m)
            level.add(cells, moments, now)

    def _forget_far(self, position: NDArray[np.float64], now: int) -> None:
        """Drop what is far from the sensor's position (3,) or was not seen for long."""
        place = (position - self._origin)[:, None]
        for level in self._levels:
            near = np.abs(level.means - place).max(axis=0) < self.radius_m
            level.keep(near & (now - level.last_seen <= self.memory_frames))


def _moved(
    points: NDArray[Any], rotation: NDArray[np.float64], shift: NDArray[np.float64]
) -> NDArray[Any]:
    """Coordinates (3, N), in the points' own precision, of points (N, 3) turned and shifted."""
    columns = np.ascontiguousarray(points.T)
    moved = np.einsum("ij,jn->in", rotation.astype(columns.dtype), columns)
    moved += shift.astype(columns.dtype)[:, None]
    return moved


def _merged(
    cells: NDArray[np.int64], moments: NDArray[np.float64], size_m: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Cells (3, V) and moments (10, V) of voxels whose edge is twice that of given ones, size."""
    coarse = cells >> 1
    order, starts = voxel.group_by_cell(coarse)
    shift = ((cells & 1).astype(np.float64) - 0.5) * (size_m / 2)
    moved = planes.shift_moments(moments, shift).take(order, axis=1)
    return coarse.take(order.take(starts), axis=1), np.add.reduceat(moved, starts, axis=1)
