"""Robust point-to-plane ICP of one frame against the local map, and the score of a pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray
from lidaraccum.geometry import rigid
from lidaraccum.geometry.order import middle
from lidaraccum.registration.plane_index import Matches
from lidaraccum.registration.surface_map import SurfaceMap

GATE_SPREADS = 3.0
"""The kernel's scale, in spreads (1.48 median) of the distances of the iteration before."""

MIN_SCALE_M, MAX_SCALE_M = 0.05, 0.5
"""Bounds of the kernel's scale."""

SCORE_GATE_M = 0.2
"""Distance to the plane at which a point no longer speaks for a pose."""

HOLD = 2e-4
"""Weight, beside the average plane's 1, of staying at the start: it decides only directions that
the planes leave open (along a tunnel), where it keeps the prediction."""

RAIL = 1e3
"""The same along a rail: no plane counts against it."""

MOST_FACE = 0.5
LEANING = np.cos(np.deg2rad(15.0))
"""With more than this share of the planes facing one way, those within this angle of it are taken
to face that way."""

STOP_RAD, STOP_M = 2e-5, 5e-4
"""An iteration that moves the pose by less than this is the last."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """A pose and how well the map speaks for it.

    Attributes:
        world_from_sensor: (4, 4).
        score: 0..1: truncated quadratic agreement, averaged over all points with every direction
            of plane counting alike, so that much ground does not outvote few walls.
        overlap: 0..1: share of the points with a plane within the gate.
        residual_m: Median distance to those planes.
        information: (6, 6) of rotation about the sensor, then translation, world axes, per point.
    """

    world_from_sensor: rigid.Pose
    score: float
    overlap: float
    residual_m: float
    information: NDArray[np.float64]


def align(
    surface: SurfaceMap,
    points: NDArray[np.float64],
    start: rigid.Pose,
    *,
    finest: int = 0,
    iterations: int = 15,
    rail: NDArray[np.float64] | None = None,
) -> rigid.Pose:
    """The pose near ``start`` that lays points (M, 3), sensor coordinates, onto the map's planes.

    Gauss-Newton on point-to-plane distances under a Geman-McClure kernel, whose scale follows the
    spread of the distances (Chebrolu et al. 2021 show why it must). Along a ``rail`` (3,), world,
    it stays where it is.
    """
    pose = start.copy()
    columns = np.ascontiguousarray(points.T)
    hold = HOLD * np.eye(6)
    if rail is not None:
        hold[3:, 3:] += RAIL * np.outer(rail, rail)
    for _ in range(iterations):
        matches = surface.match(_placed(columns, pose), finest)
        if len(matches.rows) < 6:
            break
        away = np.concatenate([np.zeros(3), pose[:3, 3] - start[:3, 3]])
        step = _solve(matches, pose[:3, 3], away, hold)
        pose = moved(pose, step)
        if np.abs(step[:3]).max() < STOP_RAD and np.abs(step[3:]).max() < STOP_M:
            break
    return pose


def moved(pose: rigid.Pose, step: NDArray[np.float64]) -> rigid.Pose:
    """A pose turned about its own place, then shifted, by a small step (6,), world axes."""
    result = pose.copy()
    result[:3, :3] = rigid.rotation(step[:3]) @ pose[:3, :3]
    result[:3, 3] += step[3:]
    return result


def _placed(columns: NDArray[np.float64], pose: rigid.Pose) -> NDArray[np.float64]:
    """Where coordinates (3, N) lie in the world."""
    return pose[:3, :3] @ columns + pose[:3, 3:]


def main_face(matches: Matches) -> tuple[NDArray[np.float64], BoolArray]:
    """The way (3,) that most planes face, as the ground's do, and which (M,) face it; else none."""
    normals, weights = matches.normals, matches.weights
    spread = (normals * weights) @ normals.T / max(float(weights.sum()), 1e-9)
    share, axes = np.linalg.eigh(spread)
    if share[2] < MOST_FACE:
        return axes[:, 2], np.zeros(len(weights), dtype=np.bool_)
    return axes[:, 2], np.abs(axes[:, 2] @ normals) > LEANING


def jacobian(arms: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """How distances change with a step: (6, M), of arms (3, M) from the sensor, normals (3, M)."""
    slopes = np.empty((6, arms.shape[1]))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.subtract(arms[i] * normals[j], arms[j] * normals[i], out=slopes[k])
    slopes[3:] = normals
    return slopes


def kernel_weights(matches: Matches, alike: BoolArray) -> NDArray[np.float64]:
    """Geman-McClure weights (M,) at the scale of the distances themselves, thin planes first.

    Those that face one way (M,) have a scale of their own: much smooth ground would make outliers
    of all that stands on it.
    """
    away = np.abs(matches.distances)
    scale = np.where(alike, _scale(away[alike]), _scale(away[~alike]))
    return matches.weights / (1.0 + (away / scale) ** 2) ** 2


def _scale(away: NDArray[np.float64]) -> float:
    """The kernel's scale for distances (M,), metres, without their signs."""
    spread = 1.48 * middle(away) if len(away) else 0.0
    return min(max(GATE_SPREADS * spread, MIN_SCALE_M), MAX_SCALE_M)


def _solve(
    matches: Matches,
    place: NDArray[np.float64],
    away: NDArray[np.float64],
    hold: NDArray[np.float64],
) -> NDArray[np.float64]:
    """One step (6,) of a sensor at a place (3,).

    ``hold`` (6, 6), per plane, draws back by what it is ``away`` (6,).

    The little by which each of the planes leans that face one way is roughness, or an error: a
    voxel that one beam crossed knows its plane along the beam only, so the same beam a little
    further fits best where the sensor has not moved. Such planes fix the way they face, no more.
    """
    face, alike = main_face(matches)
    normals = matches.normals
    normals = np.where(alike, (face @ normals) * face[:, None], normals)
    weights = kernel_weights(matches, alike)
    slopes = jacobian(matches.places - place[:, None], normals)
    weighted = slopes * weights
    held = weights.sum() * hold
    gradient = weighted @ matches.distances + held @ away
    return -np.linalg.solve(weighted @ slopes.T + held, gradient)


def assess(
    surface: SurfaceMap, points: NDArray[np.float64], pose: rigid.Pose, *, finest: int = 0
) -> Alignment:
    """How well the map speaks for a pose of points (M, 3), sensor coordinates."""
    matches = surface.match(_placed(points.T, pose), finest)
    close = np.abs(matches.distances) < SCORE_GATE_M
    if close.sum() < 6:
        return Alignment(pose, 0.0, 0.0, float("inf"), np.zeros((6, 6)))
    agreement = np.maximum(0.0, 1.0 - (matches.distances / SCORE_GATE_M) ** 2)
    rarity = _rarity(matches.normals)
    # Points without a plane (new space, clutter) count as the average point does.
    share = len(matches.rows) / max(len(points), 1)
    slopes = jacobian(matches.places - pose[:3, 3:], matches.normals)
    weights = kernel_weights(matches, main_face(matches)[1])
    information = (slopes * weights) @ slopes.T
    return Alignment(
        pose,
        score=share * float((rarity * agreement).sum() / rarity.sum()),
        overlap=float(close.sum()) / max(len(points), 1),
        residual_m=middle(np.abs(matches.distances[close])),
        information=information / len(matches.rows),
    )


def _rarity(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Leverage (M,) of each normal (3, M): large where few others point its way."""
    spread = normals @ normals.T / normals.shape[1]
    inverse = np.linalg.inv(spread + 0.01 * np.eye(3))
    return np.einsum("ji,ji->i", normals, inverse @ normals)
