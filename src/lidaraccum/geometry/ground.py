"""The frame's own ground: which way is up, and how high each point stands above the road.

Quick and rough on purpose: the network's only use of height, for any mount, slope or origin. The
first step finds the plane the vehicle stands on and levels the frame by it; the second follows the
ground away from that plane, cell by cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lidaraccum.geometry.grid import centres, interpolated
from lidaraccum.geometry.rigid import Pose, transform

REACH_M = 64.0
"""Half width of the ground map; points further out take the height at its edge."""
CELL_M = 2.0
PLANE_REACH_M = 25.0
"""The plane is that of the ground this near; further out roads bend."""
PLANE_INLIER_M = 0.15
STEEPEST_MOUNT = 0.5
"""Planes steeper than this (rise over run) are walls, whatever they score."""
OPENING_CELLS = 5
"""What is narrower than this stands on the ground; wider things are hills."""
STEP_M = 0.2
"""A cell that begins so far above the ground around it holds none: a car's sill, say."""
SLOPE = 0.15
"""Ground rises by at most this over ground beside it (rise over run)."""
STRAY_M = 0.7
"""A cell this far below nearly all that is around it holds a stray echo, not ground."""
STRAY_CELLS = 4
"""As many cells side by side may hold strays: a mirror image of something in a wet road, say."""
FLAT_M = 0.3
"""Points this near the plane are of the road that no ray passes."""
ROAD_POINTS, DITCH_POINTS = 3, 8
"""A cell with so many of them holds the road; with so many deeper ones, and no road, a ditch.
Fewer deeper ones than the first number are strays."""
THIN_SHARE = 0.1
RING_M = 4.0
"""So are fewer than this share of what cells of the road hold that are as far away."""
FEWEST_IN_COMPANY = 12
"""Where fewer cells hold points that have company, points alone tell the plane, too."""
LEAST_SHARE = 0.25
"""A plane with less than this share of the cells of the fullest is no ground, though nothing lies
below it: single echoes from far below a wet road have nothing below them."""
LEAST_MOUNT_M = 0.5
"""Where the sensor seems lower than this above the road, its coordinates start elsewhere."""

_CELLS = int(2 * REACH_M / CELL_M)
_DEEPEST_MM = 1 << 17
_TRIALS = 200
_CONE_CELLS = 4


@dataclass(frozen=True, eq=False)
class Ground:
    """The ground under one frame.

    Attributes:
        level_from_sensor: (4, 4): turns the ground's normal upright and puts z = 0 on its plane;
            x and y keep their origin, and their directions but for the tilt.
        heights: (G, G) float64, metres: z of the ground in level coordinates at cell centres, x by
            row, y by column.
    """

    level_from_sensor: Pose
    heights: NDArray[np.float64]

    def height_above(self, level_points: NDArray[Any]) -> NDArray[np.float64]:
        """Height (N,) above the ground of points (N, 3), metres, in level coordinates."""
        x, y = level_points[:, :2].T
        ground = interpolated(self.heights, x, y, reach_m=REACH_M, cell_m=CELL_M)
        return level_points[:, 2] - ground


def estimate_ground(points: NDArray[Any]) -> Ground:
    """Ground of the points (N, 3) of one frame, metres, sensor coordinates, z roughly up.

    Works without any ground in sight too (then level is the sensor's own level, at the height of
    the lowest points), and does not depend on the order of the points.
    """
    return level_by_ground(points)[0]


def level_by_ground(points: NDArray[Any]) -> tuple[Ground, NDArray[np.float64]]:
    """As `estimate_ground`, and the points (N, 3) in its level coordinates, laid out as they are.

    Quickest column by column.
    """
    lowest = _without_strays(_lowest(points))
    plane = _fit_plane(lowest, _without_strays(_lowest_in_company(points)))
    level_from_sensor = _levelling(plane)
    level = transform(level_from_sensor, points)
    deep = level[:, 2] < -FLAT_M
    low = _lowest(level, ~deep)
    if deep.any():
        below = level[deep]
        flat = level[np.abs(level[:, 2]) < FLAT_M]
        is_ground = _are_ground(below, flat, float(level_from_sensor[2, 3]))
        low = np.fmin(low, _lowest(below[is_ground]))
    return Ground(level_from_sensor, _follow(_without_strays(low))), level


def _are_ground(
    deep: NDArray[np.float64], flat: NDArray[np.float64], mount_m: float
) -> NDArray[np.bool_]:
    """Which of the deep points (N, 3) are neither strays nor met through the road: mirror images.

    The road (points near its plane, (M, 3)) must have been seen where the ray crosses the plane. A
    ditch or a slope beyond the road's edge is not under it: half way from there to the point lies
    nothing of the road, but much that is as deep.
    """
    counts, on_road = _counts(deep), _counts(flat)
    counts[counts < THIN_SHARE * _usual(on_road)] = 0
    has_company = _look_up(counts >= ROAD_POINTS, deep)
    if mount_m < LEAST_MOUNT_M:
        return has_company
    road = on_road >= ROAD_POINTS
    ditch = (counts >= DITCH_POINTS) & ~road
    crossing = mount_m / (mount_m - deep[:, 2])
    at_crossing = _look_up(road, deep[:, :2] * crossing[:, None])
    half_way = _look_up(ditch, deep[:, :2] * (0.5 + 0.5 * crossing)[:, None])
    return has_company & ~(at_crossing & ~half_way)


def _usual(counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Mean count (G, G) of cells that hold any, for each cell of those as far from the sensor."""
    ring = (np.hypot(*centres(reach_m=REACH_M, cell_m=CELL_M)) / RING_M).astype(np.int64).ravel()
    taken = np.bincount(ring, counts.ravel() > 0)
    return (np.bincount(ring, counts.ravel()) / np.maximum(taken, 1))[ring].reshape(counts.shape)


def _look_up(cells: NDArray[np.bool_], xy: NDArray[Any]) -> NDArray[np.bool_]:
    """What a map (G, G) says at places (N, 2), metres; False beyond its edge."""
    inside, key = _keys(xy)
    found = np.zeros(len(xy), dtype=bool)
    found[inside] = cells.ravel()[key]
    return found


def _counts(points: NDArray[Any]) -> NDArray[np.int64]:
    """Points (N, 3) in each cell, (G, G)."""
    _, key = _keys(points)
    return np.bincount(key, minlength=_CELLS * _CELLS).reshape(_CELLS, _CELLS)


def _keys(xy: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which of places (N, 2 or more) are on the map (K,), and their cells in the flat map (K,)."""
    row, column = (xy[:, 0] + REACH_M) / CELL_M, (xy[:, 1] + REACH_M) / CELL_M
    inside = np.flatnonzero((row >= 0) & (row < _CELLS) & (column >= 0) & (column < _CELLS))
    return inside, row[inside].astype(np.int64) * _CELLS + column[inside].astype(np.int64)


def _lowest(points: NDArray[Any], chosen: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
    """Lowest z (G, G) of points (N, 3), or of those chosen (N,), in each cell; NaN without any."""
    inside, key = _keys(points)
    z = points[inside, 2].astype(np.float64)
    if chosen is not None:
        z[~chosen[inside]] = np.inf
    low = np.full(_CELLS * _CELLS, np.inf)
    np.minimum.at(low, key, z)
    low[~np.isfinite(low)] = np.nan
    return low.reshape(_CELLS, _CELLS)


def _lowest_in_company(points: NDArray[Any]) -> NDArray[np.float64]:
    """Lowest z (G, G), to the mm, that has company in its cell of points (N, 3); NaN without."""
    inside, key = _keys(points)
    depth = np.clip(np.floor(1000.0 * points[inside, 2]), -_DEEPEST_MM, _DEEPEST_MM - 1)
    packed = key * (2 * _DEEPEST_MM) + depth.astype(np.int64) + _DEEPEST_MM  # sorts fast
    packed.sort()
    few = ROAD_POINTS - 1
    lowest = packed[: len(packed) - few][packed[few:] - packed[:-few] < 1000 * FLAT_M]
    cell, first = np.unique(lowest // (2 * _DEEPEST_MM), return_index=True)
    low = np.full((_CELLS, _CELLS), np.nan)
    low.ravel()[cell] = (lowest[first] % (2 * _DEEPEST_MM) - _DEEPEST_MM) / 1000.0
    return low


def _without_strays(low: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cells far below all cells around them, but for a few as low, blanked."""
    around = np.ones((5, 5), dtype=bool)
    around[2, 2] = False
    beside = ndimage.rank_filter(
        np.where(np.isnan(low), np.inf, low), STRAY_CELLS - 1, footprint=around, mode="nearest"
    )
    return np.asarray(np.where(low < beside - STRAY_M, np.nan, low), dtype=np.float64)


def _fit_plane(low: NDArray[np.float64], firm: NDArray[np.float64]) -> NDArray[np.float64]:
    """(a, b, c) of z = a x + b y + c, through as many cells' lowest points (G, G) as can be.

    Which plane, the lowest that have company tell, ``firm`` (G, G), where there are enough.
    """
    rows, z = _near_cells(low)
    if len(z) < 6:
        floor = np.nanmin(low) if not np.isnan(low).all() else 0.0
        return np.array([0.0, 0.0, float(floor)])
    voters = _near_cells(firm)
    plane = _vote(*voters) if len(voters[1]) >= FEWEST_IN_COMPANY else _vote(rows, z)
    for _ in range(3):
        kept = np.abs(rows @ plane - z) < PLANE_INLIER_M
        if np.count_nonzero(kept) < 6:
            break
        plane = np.asarray(np.linalg.lstsq(rows[kept], z[kept], rcond=None)[0], dtype=np.float64)
    return plane


def _near_cells(low: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows (K, 3) of x, y and 1 of the known cells near the sensor, and their z (K,), metres."""
    x, y = centres(reach_m=REACH_M, cell_m=CELL_M)
    near = (np.hypot(x, y) < PLANE_REACH_M) & ~np.isnan(low)
    return np.stack([x[near], y[near], np.ones(np.count_nonzero(near))], axis=1), low[near]


def _vote(rows: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """The best of many planes through three cells: many on it, few below it."""
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(z), (_TRIALS, 3))
    systems, sides = rows[picks], z[picks]
    sound = np.abs(np.linalg.det(systems)) > 10.0
    flat = np.array([[0.0, 0.0, float(np.median(z))]])
    planes = np.concatenate(
        [flat, np.linalg.solve(systems[sound], sides[sound][..., None])[..., 0]]
    )
    planes = planes[np.hypot(planes[:, 0], planes[:, 1]) < STEEPEST_MOUNT]
    above = z - planes @ rows.T
    on_it = np.count_nonzero(np.abs(above) < PLANE_INLIER_M, axis=1)
    below_it = np.count_nonzero(above < -3 * PLANE_INLIER_M, axis=1)
    score = np.where(on_it >= LEAST_SHARE * on_it.max(), on_it - 2 * below_it, -np.inf)
    return planes[int(np.argmax(score))]


def _levelling(plane: NDArray[np.float64]) -> Pose:
    """The smallest turn that makes the plane's normal upright, and the drop to z = 0."""
    normal = np.array([-plane[0], -plane[1], 1.0])
    length = float(np.linalg.norm(normal))
    normal /= length
    axis = np.array([normal[1], -normal[0], 0.0])
    cross = np.array([[0, 0, axis[1]], [0, 0, -axis[0]], [-axis[1], axis[0], 0]])
    level_from_sensor = np.eye(4)
    level_from_sensor[:3, :3] += cross + cross @ cross / (1.0 + normal[2])
    level_from_sensor[2, 3] = -plane[2] / length
    return level_from_sensor


def _follow(low: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ground (G, G) under the lowest points (G, G): opened, bridged, no steeper than slope allows.

    Cars, buildings and bushes that hide the ground stick out of it and fall away; their cells, and
    those without points, take the nearest ground's height.
    """
    known = ~np.isnan(low)
    if not known.any():
        return np.zeros((_CELLS, _CELLS))
    eroded = ndimage.minimum_filter(np.where(known, low, np.inf), size=OPENING_CELLS)
    opened = ndimage.maximum_filter(
        np.where(np.isfinite(eroded), eroded, -np.inf), size=OPENING_CELLS
    )
    stands = ~known
    stands[known] = low[known] - opened[known] >= STEP_M
    nearest = ndimage.distance_transform_edt(stands, return_distances=False, return_indices=True)
    reach = np.arange(-_CONE_CELLS, _CONE_CELLS + 1) * CELL_M
    cone = SLOPE * np.hypot(*np.meshgrid(reach, reach, indexing="ij"))
    ground = ndimage.grey_erosion(low[tuple(nearest)], structure=-cone, mode="nearest")
    return ndimage.uniform_filter(ground, size=3, mode="nearest")
