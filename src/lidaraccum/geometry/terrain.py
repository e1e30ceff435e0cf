"""The ground under one frame, as a height map, and how far above it points lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lidaraccum.geometry.grid import centres, interpolated
from lidaraccum.geometry.ground import estimate_ground
from lidaraccum.geometry.rigid import transform

CELL_M = 1.0
REACH_M = 80.0

HIGHEST_M, LOWEST_M = 0.3, -0.5
"""A cell that begins so far above the rough ground holds none, nor one so far below it."""

ROAD_REACH_M = 10.0
ROAD_STEP_M = 0.3
"""So near, the road is a plane, and a cell that begins so far above it holds no ground: close
beside a van nothing of the road is in sight, and its sill would pass for the ground."""

ROAD_SOFT_M = 0.1
ROAD_ROUNDS = 10
FEWEST_CELLS = 12

_CELLS = int(2 * REACH_M / CELL_M)
_DEPTH_BITS = 18
_DEPTH_MM = 1 << (_DEPTH_BITS - 1)


@dataclass(frozen=True, eq=False)
class Terrain:
    """Ground heights on a square grid about the sensor.

    Attributes:
        heights: (G, G) float64, metres, z of the ground at cell centres, x by row, y by column.
    """

    heights: NDArray[np.float64]

    def height_above(self, points: NDArray[Any]) -> NDArray[np.float64]:
        """Height (N,) above the ground of points (N, 3), metres, in the frame's coordinates."""
        x, y = np.ascontiguousarray(points[:, :2].T, dtype=np.float32)
        heights = interpolated(self.heights, x, y, reach_m=REACH_M, cell_m=CELL_M)
        return points[:, 2] - heights.astype(np.float64)


def estimate_terrain(points: NDArray[Any]) -> Terrain:
    """Ground under the points (N, 3) of one frame, metres, z up, about the sensor.

    Lowest points of cells that lie near the rough ground (`ground`); cells without ground take the
    nearest cell's. Stray echoes from below are passed over where a cell has points enough.
    """
    low = _low_points(points)
    known = np.isfinite(low)
    if not known.any():
        return Terrain(np.zeros((_CELLS, _CELLS)))
    above = _above_rough_ground(low, points)
    with np.errstate(invalid="ignore"):
        ground = known & (above < HIGHEST_M) & (above > LOWEST_M)
        ground &= ~(low - _road(low) > ROAD_STEP_M)
    if not ground.any():
        return Terrain(np.zeros((_CELLS, _CELLS)))
    nearest = ndimage.distance_transform_edt(~ground, return_distances=False, return_indices=True)
    return Terrain(ndimage.median_filter(low[tuple(nearest)], size=3))


def _above_rough_ground(low: NDArray[np.float64], points: NDArray[Any]) -> NDArray[np.float64]:
    """How far above the ground, as `ground` has it, cells begin (G, G), metres."""
    rough = estimate_ground(points)
    x, y = centres(reach_m=REACH_M, cell_m=CELL_M)
    cells = np.column_stack([x.ravel(), y.ravel(), np.where(np.isfinite(low), low, 0.0).ravel()])
    return rough.height_above(transform(rough.level_from_sensor, cells)).reshape(low.shape)


def _road(low: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height (G, G) of the plane under the lowest of the cells near the sensor; NaN farther out.

    What lies off the plane counts less and less. NaN too where few cells are known.
    """
    x, y = centres(reach_m=REACH_M, cell_m=CELL_M)
    plane = np.full(low.shape, np.nan)
    near = np.hypot(x, y) < ROAD_REACH_M
    used = near & np.isfinite(low)
    if used.sum() < FEWEST_CELLS:
        return plane
    place = np.column_stack([x[used], y[used], np.ones(int(used.sum()))])
    height = low[used]
    fit = np.array([0.0, 0.0, np.percentile(height, 25)])
    for _ in range(ROAD_ROUNDS):
        above = height - place @ fit
        weights = 1.0 / (1.0 + (np.abs(above) / ROAD_SOFT_M) ** 2)
        weighted = place * weights[:, None]
        fit = np.linalg.solve(weighted.T @ place + 1e-3 * np.eye(3), weighted.T @ height)
    plane[near] = fit[0] * x[near] + fit[1] * y[near] + fit[2]
    return plane


def _low_points(points: NDArray[Any]) -> NDArray[np.float64]:
    """Nearly lowest z (G, G) of each cell's points, inf where there are none."""
    x, y, z = np.ascontiguousarray(points.T, dtype=np.float32)
    inside = np.flatnonzero((np.abs(x) < REACH_M) & (np.abs(y) < REACH_M))
    row, column = (
        ((across.take(inside) + np.float32(REACH_M)) * np.float32(1 / CELL_M)).astype(np.int32)
        for across in (x, y)
    )
    # Cell and height packed into one integer sort much faster than a lexical sort of both.
    millimetres = np.clip(z.take(inside) * np.float32(1000), -_DEPTH_MM, _DEPTH_MM - 1)
    packed = (np.minimum(row, _CELLS - 1) * _CELLS + np.minimum(column, _CELLS - 1)).astype(
        np.int64
    )
    packed <<= _DEPTH_BITS
    packed += millimetres.astype(np.int32) + _DEPTH_MM
    packed.sort()
    key, raised = packed >> _DEPTH_BITS, packed & (2 * _DEPTH_MM - 1)
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    counts = np.diff(np.append(starts, len(key)))
    chosen = starts + np.minimum(counts - 1, np.where(counts > 20, 3, 1))
    low = np.full(_CELLS * _CELLS, np.inf)
    low[key[starts]] = (raised[chosen] - _DEPTH_MM) / 1000.0
    return low.reshape(_CELLS, _CELLS)
