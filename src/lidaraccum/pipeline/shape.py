"""A mover's growing shape: new points are fitted to all it has shown so far, then join it."""

from __future__ import annotations

from dataclasses import dataclass

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
STEPS = 4

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

    def _take(self, points: NDArray[np.float64]) -> None:
        self._points = points
        self._tree = cKDTree(points)
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
        before = self._residual(chosen)
        total = np.zeros(4)
        for _ in range(STEPS):
            step = self._step(rigid.transform(_level_motion(total), chosen), total)
            total = total + step
            if np.abs(step).max() < 1e-3:
                break
        correction = _level_motion(total)
        after = self._residual(rigid.transform(correction, chosen))
        too_far = np.hypot(total[0], total[1]) > MAX_SHIFT_M or abs(total[3]) > MAX_TURN
        if too_far or not after < before:
            return ShapeFit(np.eye(4), before)
        return ShapeFit(correction, after)

    def _step(self, moved: NDArray[np.float64], total: NDArray[np.float64]) -> NDArray[np.float64]:
        """One Gauss-Newton step (4,): x, y, z metres and turn, radians."""
        lag, information = self._surface_at(moved)
        if len(lag) == 0:
            return np.zeros(4)
        known = np.isfinite(lag[:, 0])
        lag, information, moved = lag[known], information[known], moved[known]
        if len(lag) == 0:
            return np.zeros(4)
        jacobian = np.zeros((len(moved), 3, 4))
        jacobian[:, 0, 0] = jacobian[:, 1, 1] = jacobian[:, 2, 2] = 1.0
        jacobian[:, 0, 3], jacobian[:, 1, 3] = -moved[:, 1], moved[:, 0]
        scale = min(1.0, EFFECTIVE_POINTS / len(moved))
        weighted = scale * np.einsum("nki,nkl->nil", jacobian, information)
        prior = np.diag(1.0 / PRIOR**2)
        normal = np.einsum("nil,nlj->ij", weighted, jacobian) + prior
        side = np.einsum("nil,nl->i", weighted, lag) - prior @ total
        return np.linalg.solve(normal, side)

    def _surface_at(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Way (N, 3) from each point to the shape near it, NaN without, and its certainty."""
        centre, normal, flatness, spread, near = self._planes(points)
        lag = centre - points
        across = np.einsum("ni,ni->n", lag, normal)
        trust = near / (1.0 + (across / ROBUST_M) ** 2) ** 2
        outer = normal[:, :, None] * normal[:, None, :]
        # Off the edge of what was seen so far there is more of the surface, not a lag along it.
        beside = np.linalg.norm(lag - across[:, None] * normal, axis=1) < EDGE_SPREADS * spread
        information = outer * (flatness / ACROSS_M**2)[:, None, None]
        information = information + np.eye(3) * (beside / ALONG_M**2)[:, None, None]
        lag[~near] = np.nan
        return lag, information * trust[:, None, None]

    def _planes(
        self, points: NDArray[np.float64]
    ) -> tuple[
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.bool_],
    ]:
        """Planes at points (N, 3): centres, normals (N, 3); flatness, spread m, nearness (N,)."""
        count = min(NEIGHBOURS, len(self._points))
        distance, rows = self._tree.query(points, k=count)
        distance, rows = distance.reshape(len(points), count), rows.reshape(len(points), count)
        around = self._points[rows]
        centre = around.mean(axis=1)
        spread = around - centre[:, None]
        second = np.matmul(spread.transpose(0, 2, 1), spread) / count
        normals, variances = plane_normals(second[:, _UPPER[0], _UPPER[1]])
        least, middle, most = variances.T
        # Neighbours on one line, as those of one beam are, tell no normal.
        flatness = np.clip(2 * (middle - least) / np.maximum(most, 1e-9), 0, 1)
        spread_m = np.sqrt(variances.sum(axis=1))
        return centre, normals, flatness, spread_m, distance[:, 0] < REACH_M

    def _residual(self, points: NDArray[np.float64]) -> float:
        centre, normal, _, _, near = self._planes(points)
        across = np.abs(np.einsum("ni,ni->n", centre - points, normal))
        return float(np.median(np.where(near, across, REACH_M)))


def _level_motion(values: NDArray[np.float64]) -> rigid.Pose:
    x, y, z, turn = values
    motion = rigid.translation((x, y, z))
    motion[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    return motion
