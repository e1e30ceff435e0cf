"""A mover's growing shape: new points are fitted to all it has shown so far, then join it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.geometry import rigid
from lidaraccum.geometry.planes import plane_normals
from lidaraccum.geometry.voxel import thin

GRAIN_M = 0.05
MAX_POINTS = 3000
FIT_POINTS = 120
NEIGHBOURS = 8
REACH_M = 0.5
SEARCHES = 3
STEPS = 2
"""The surface near the points is looked for so often, and so many steps are taken each time."""

AT_REST_M = 0.01
"""Not again where the steps since the last time moved no point farther."""

ACROSS_M = 0.03
ALONG_M = 0.6
"""A point is this sure to lie on the surface near it, and this sure of its place along it."""

EDGE_SPREADS = 1.5
"""A point farther from its neighbours' centre than so many times their spread is off their edge."""

ROBUST_M = 0.1
PRIOR = np.array([0.1, 0.1, 0.1, 0.05])
"""How far a prediction may be out: metres in x, y and z, radians about the upright axis."""

EFFECTIVE_POINTS = 60
"""More points than this make the fit no surer against the prediction: their errors are alike."""

BOX_QUANTILE = 0.02
BOX_MARGIN_M = 0.1

MAX_SHIFT_M = 0.6
MAX_TURN = 0.2

_UPPER = np.triu_indices(3)


@dataclass(frozen=True, eq=False)
class ShapeFit:
    """How points fit a shape.

    Attributes:
        correction: (4, 4): moves the points onto the shape; identity where that did not pay.
        residual_m: Median distance to the shape's surface after it.
    """

    correction: rigid.Pose
    residual_m: float


class ObjectShape:
    """All that was seen of one object, in its own coordinates (metres, z up)."""

    def __init__(self, points: NDArray[np.float64]) -> None:
        self._take(points[thin(points, GRAIN_M)])

    def __len__(self) -> int:
        return len(self._points)

    @property
    def radius_m(self) -> float:
        """Nothing of it is farther from its origin, seen from above."""
        return self._radius_m

    @property
    def length_m(self) -> float:
        """Longer side, seen from above, of the box about all but the outermost of it."""
        low, high = self._box
        return float((high - low)[:2].max())

    def _take(self, points: NDArray[np.float64]) -> None:
        self._points = points
        self._columns = np.ascontiguousarray(points.T)
        self._tree = cKDTree(points, balanced_tree=False)
        self._radius_m = float(np.hypot(points[:, 0], points[:, 1]).max(initial=0.0))
        low, high = np.quantile(points, (BOX_QUANTILE, 1 - BOX_QUANTILE), axis=0)
        self._box = low - BOX_MARGIN_M, high + BOX_MARGIN_M

    def distances(self, points: NDArray[np.float64], reach_m: float) -> NDArray[np.float64]:
        """Distance (N,) from points (N, 3) to the shape's nearest; inf beyond the reach."""
        distance, _ = self._tree.query(points, distance_upper_bound=reach_m)
        return distance

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (N, 3) lie in the box (N,) bool about all but the outermost of it."""
        low, high = self._box
        return np.asarray(((points > low) & (points < high)).all(axis=1))

    def add(self, points: NDArray[np.float64]) -> None:
        """Grow by points (N, 3); what is already there stays, so that the shape does not blur."""
        if len(points) == 0 or len(self._points) >= MAX_POINTS:
            return
        distance, _ = self._tree.query(points, distance_upper_bound=2 * GRAIN_M)
        fresh = points[distance > GRAIN_M]
        if len(fresh):
            self._take(np.concatenate([self._points, fresh[thin(fresh, GRAIN_M)]]))

    def fit(self, points: NDArray[np.float64]) -> ShapeFit:
        """Move points (N, 3), put by prediction, onto the shape; only where that lowers the rest.

        Point to surface, level but for the height, held by the prediction where the points leave
        the motion open (the flat back of a van does not tell its place sideways).
        """
        kept = thin(points, GRAIN_M)
        if len(kept) > FIT_POINTS:
            kept = kept[np.linspace(0, len(kept) - 1, FIT_POINTS).astype(np.int64)]
        chosen = points[kept]
        surface = self._surface_at(chosen)
        before = surface.residual_m
        total = np.zeros(4)
        for search in range(SEARCHES):
            start = surface.place
            if search:
                surface = self._surface_at(start.T)
            for _ in range(STEPS):
                total = total + surface.step(total)
                moved = rigid.transform(_level_motion(total), chosen)
                surface = replace(surface, place=moved.T)
            if np.abs(surface.place - start).max() < AT_REST_M:
                break
        too_far = np.hypot(total[0], total[1]) > MAX_SHIFT_M or abs(total[3]) > MAX_TURN
        if too_far or not surface.residual_m < before:
            return ShapeFit(np.eye(4), before)
        return ShapeFit(_level_motion(total), surface.residual_m)

    def _surface_at(self, points: NDArray[np.float64]) -> _Surface:
        """The planes of the shape near points (N, 3)."""
        count = min(NEIGHBOURS, len(self._points))
        distance, rows = self._tree.query(points, k=count)
        distance, rows = distance.reshape(len(points), count), rows.reshape(len(points), count)
        around = self._columns.take(rows, axis=1)
        centre = around.mean(axis=2)
        spread = around - centre[:, :, None]
        second = (spread[_UPPER[0]] * spread[_UPPER[1]]).sum(axis=2) / count
        normals, variances = plane_normals(second.T)
        least, middle, most = variances.T
        return _Surface(
            place=points.T,
            centre=centre,
            normal=normals.T,
            # Neighbours on one line, as those of one beam are, tell no normal.
            flatness=np.clip(2 * (middle - least) / np.maximum(most, 1e-9), 0, 1),
            spread_m=np.sqrt(variances.sum(axis=1)),
            near=distance[:, 0] < REACH_M,
        )


@dataclass(frozen=True, eq=False)
class _Surface:
    """The shape near N points: a plane for each.

    Attributes:
        place: (3, N) the points, metres, the shape's coordinates.
        centre: (3, N) of the planes' points.
        normal: (3, N) unit vectors.
        flatness: (N,) 0..1: how far the plane's points tell its normal.
        spread_m: (N,) of the plane's points about their centre.
        near: (N,) bool: whether there is any of the shape within reach.
    """

    place: NDArray[np.float64]
    centre: NDArray[np.float64]
    normal: NDArray[np.float64]
    flatness: NDArray[np.float64]
    spread_m: NDArray[np.float64]
    near: NDArray[np.bool_]

    @cached_property
    def lag(self) -> NDArray[np.float64]:
        """(3, N) metres from the points to the planes' centres."""
        return self.centre - self.place

    @cached_property
    def across(self) -> NDArray[np.float64]:
        """(N,) metres from the points to their planes, along the normals."""
        return np.asarray((self.lag * self.normal).sum(axis=0))

    @cached_property
    def residual_m(self) -> float:
        """Median distance to the planes."""
        return float(np.median(np.where(self.near, np.abs(self.across), REACH_M)))

    def step(self, total: NDArray[np.float64]) -> NDArray[np.float64]:
        """One Gauss-Newton step (4,), x, y, z metres and turn, radians, after those so far."""
        count = int(np.count_nonzero(self.near))
        if count == 0:
            return np.zeros(4)
        trust = self.near / (1.0 + (self.across / ROBUST_M) ** 2) ** 2
        # Off the edge of what was seen so far there is more of the surface, not a lag along it.
        aside = np.sqrt(((self.lag - self.across * self.normal) ** 2).sum(axis=0))
        beside = aside < EDGE_SPREADS * self.spread_m
        sure_across = trust * self.flatness / ACROSS_M**2
        sure_along = trust * beside / ALONG_M**2
        # A turn moves a point by (-y, x, 0).
        x, y, _ = self.place
        toward = np.vstack([self.normal, x * self.normal[1] - y * self.normal[0]])
        normal = (toward * sure_across) @ toward.T
        side = toward @ (sure_across * self.across)
        normal[range(3), range(3)] += sure_along.sum()
        turned = np.array([-(sure_along @ y), sure_along @ x, 0.0, sure_along @ (x * x + y * y)])
        normal[3, :3] += turned[:3]
        normal[:, 3] += turned
        side[:3] += self.lag @ sure_along
        side[3] += sure_along @ (x * self.lag[1] - y * self.lag[0])
        scale = min(1.0, EFFECTIVE_POINTS / count)
        prior = 1.0 / PRIOR**2
        return np.linalg.solve(scale * normal + np.diag(prior), scale * side - prior * total)


def _level_motion(values: NDArray[np.float64]) -> rigid.Pose:
    x, y, z, turn = values
    motion = rigid.translation((x, y, z))
    motion[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    return motion
