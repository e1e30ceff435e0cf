"""A sliding local map: space cut into voxels at three sizes, each with the plane of its points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray
from lidaraccum.geometry import planes, voxel

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

_UNKNOWN = np.inf


@dataclass(frozen=True)
class Matches:
    """Points and the planes they fell on.

    Attributes:
        rows: (M,) which of the points found a plane.
        anchors: (M, 3) a point of each plane: the mean of what the voxel saw, metres, world.
        normals: (M, 3) unit normals of those planes, world.
        distances: (M,) signed distances point to plane, metres.
        weights: (M,) 0..1: 1 for planes as thin as the sensor's noise.
    """

    rows: NDArray[np.int64]
    anchors: NDArray[np.float64]
    normals: NDArray[np.float64]
    distances: NDArray[np.float64]
    weights: NDArray[np.float64]


class VoxelLevel:
    """Voxels of one size, sorted by key; each with its points' moments about its centre."""

    def __init__(self, size_m: float) -> None:
        self.size_m = size_m
        self.keys = np.zeros(0, dtype=np.int64)
        self.moments = np.zeros((0, planes.MOMENTS))
        self.means = np.zeros((0, 3))
        self.normals = np.zeros((0, 3))
        self.variances = np.zeros((0, 3))
        self.last_seen = np.zeros(0, dtype=np.int64)

    def add(self, keys: voxel.Keys, moments: NDArray[np.float64], now: int) -> None:
        """Merge unique sorted voxels (V,) with their points' moments (V, 10)."""
        self._make_room(keys)
        at = np.searchsorted(self.keys, keys)
        merged = self.moments[at] * FORGETTING + moments
        self.moments[at] = merged
        self.last_seen[at] = now
        mean, covariance = planes.mean_and_covariance(merged)
        normal, variance = planes.plane_normals(covariance)
        flat = (
            (merged[:, 0] >= MIN_POINTS)
            & (variance[:, 0] < (MAX_THICKNESS * self.size_m) ** 2)
            & (variance[:, 1] > (MIN_SPREAD * self.size_m) ** 2)
            & (variance[:, 1] > MIN_FLATNESS * variance[:, 0])
        )
        self.means[at] = mean + voxel.voxel_centres(keys, self.size_m)
        self.normals[at] = normal
        self.variances[at] = np.where(flat[:, None], np.maximum(variance, 0.0), _UNKNOWN)

    def _make_room(self, keys: voxel.Keys) -> None:
        at = np.searchsorted(self.keys, keys)
        known = np.zeros(len(keys), dtype=np.bool_)
        inside = at < len(self.keys)
        known[inside] = self.keys[at[inside]] == keys[inside]
        places = at[~known]
        self.keys = np.insert(self.keys, places, keys[~known])
        for name in ("moments", "means", "normals", "variances", "last_seen"):
            setattr(self, name, np.insert(getattr(self, name), places, 0, axis=0))

    def keep(self, wanted: BoolArray) -> None:
        """Forget every voxel but the wanted (V,)."""
        for name in ("keys", "moments", "means", "normals", "variances", "last_seen"):
            setattr(self, name, getattr(self, name)[wanted])

    def planes_at(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], BoolArray]:
        """For points (N, 3): index (N,) of the voxel each lies in, and whether it has a plane."""
        if len(self.keys) == 0:
            return np.zeros(len(points), dtype=np.int64), np.zeros(len(points), dtype=np.bool_)
        keys = voxel.voxel_keys(points, self.size_m)
        at = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        return at, (self.keys[at] == keys) & (self.variances[at, 0] < _UNKNOWN)


class SurfaceMap:
    """What the last frames saw around the sensor, in world coordinates, in bounded memory."""

    def __init__(self, voxel_m: float, radius_m: float, memory_frames: int = 100) -> None:
        self.levels = tuple(VoxelLevel(voxel_m * factor) for factor in (1, 2, 4))
        self.radius_m = radius_m
        self.memory_frames = memory_frames

    def __len__(self) -> int:
        return len(self.levels[0].keys)

    def insert(self, points: NDArray[np.float64], now: int) -> None:
        """Add one frame's points (N, 3), world coordinates, seen in frame ``now``."""
        if len(points) == 0:
            return
        size = self.levels[0].size_m
        keys = voxel.voxel_keys(points, size)
        order, starts = voxel.group_by_key(keys)
        unique = keys[order[starts]]
        counts = np.diff(np.append(starts, len(keys)))
        centres = voxel.voxel_centres(unique, size)
        local = points[order] - np.repeat(centres, counts, axis=0)
        moments = planes.summed_moments(local, starts)
        self.levels[0].add(unique, moments, now)
        for level in self.levels[1:]:
            coarse_keys = voxel.voxel_keys(centres, level.size_m)
            shift = centres - voxel.voxel_centres(coarse_keys, level.size_m)
            order, starts = voxel.group_by_key(coarse_keys)
            moved = planes.shift_moments(moments, shift)[order]
            level.add(coarse_keys[order[starts]], np.add.reduceat(moved, starts, axis=0), now)

    def forget_far(self, position: NDArray[np.float64], now: int) -> None:
        """Drop what is far from the sensor's position (3,) or was not seen for long."""
        if now % FORGET_EVERY:
            return
        for level in self.levels:
            near = np.abs(level.means - position).max(axis=1) < self.radius_m
            level.keep(near & (now - level.last_seen <= self.memory_frames))

    def match(self, points: NDArray[np.float64], finest: int = 0) -> Matches:
        """Planes under points (N, 3), world coordinates: the finest that is there.

        Args:
            points: (N, 3) metres, world.
            finest: Level to begin with: 0 all, 1 without the finest, 2 the coarsest only.
        """
        rows, anchors, normals, distances, weights = [], [], [], [], []
        open_rows = np.arange(len(points))
        for level in self.levels[finest:]:
            at, found = level.planes_at(points[open_rows])
            hit, at = open_rows[found], at[found]
            anchor, normal = level.means[at], level.normals[at]
            rows.append(hit)
            anchors.append(anchor)
            normals.append(normal)
            distances.append(np.einsum("ij,ij->i", points[hit] - anchor, normal))
            weights.append(SENSOR_NOISE_M**2 / (SENSOR_NOISE_M**2 + level.variances[at, 0]))
            open_rows = open_rows[~found]
        return Matches(
            np.concatenate(rows),
            np.concatenate(anchors),
            np.concatenate(normals),
            np.concatenate(distances),
            np.concatenate(weights),
        )
