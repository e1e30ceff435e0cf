"""Robust point-to-plane ICP of one frame against the local map, and the score of a pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lidaraccum.data.frame import BoolArray
from lidaraccum.geometry import rigid
from lidaraccum.registration.surface_map import Matches, SurfaceMap

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
    hold = HOLD * np.eye(6)
    if rail is not None:
        hold[3:, 3:] += RAIL * np.outer(rail, rail)
    for _ in range(iterations):
        placed = rigid.transform(pose, points)
        matches = surface.match(placed, finest)
        if len(matches.rows) < 6:
            return pose
        away = np.concatenate([np.zeros(3), pose[:3, 3] - start[:3, 3]])
        step = _solve(matches, placed[matches.rows] - pose[:3, 3], away, hold)
        pose = moved(pose, step)
        if np.abs(step[:3]).max() < STOP_RAD and np.abs(step[3:]).max() < STOP_M:
            break
    return pose


def moved(pose: rigid.Pose, step: NDArray[np.float64]) -> rigid.Pose:
    """A pose turned about its own place, then shifted, by a small step (6,), world axes."""
    result = pose.copy()
    turned = Rotation.from_rotvec(step[:3]) * Rotation.from_matrix(pose[:3, :3])
    result[:3, :3] = turned.as_matrix()
    result[:3, 3] += step[3:]
    return result


def main_face(matches: Matches) -> tuple[NDArray[np.float64], BoolArray]:
    """The way (3,) that most planes face, as the ground's do, and which (M,) face it; else none."""
    normals, weights = matches.normals, matches.weights
    spread = (normals * weights[:, None]).T @ normals / max(float(weights.sum()), 1e-9)
    share, axes = np.linalg.eigh(spread)
    if share[2] < MOST_FACE:
        return axes[:, 2], np.zeros(len(normals), dtype=np.bool_)
    return axes[:, 2], np.abs(normals @ axes[:, 2]) > LEANING


def jacobian(arms: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """How distances (M,) change with a step (6,): arms (M, 3) reach from the sensor."""
    return np.concatenate([np.cross(arms, normals), normals], axis=1)


def kernel_weights(matches: Matches, alike: BoolArray) -> NDArray[np.float64]:
    """Geman-McClure weights (M,) at the scale of the distances themselves, thin planes first.

    Those that face one way (M,) have a scale of their own: much smooth ground would make outliers
    of all that stands on it.
    """
    weights = matches.weights.copy()
    for group in (alike, ~alike):
        distances = matches.distances[group]
        if len(distances):
            spread = 1.48 * float(np.median(np.abs(distances)))
            scale = float(np.clip(GATE_SPREADS * spread, MIN_SCALE_M, MAX_SCALE_M))
            weights[group] /= (1.0 + (distances / scale) ** 2) ** 2
    return weights


def _solve(
    matches: Matches,
    arms: NDArray[np.float64],
    away: NDArray[np.float64],
    hold: NDArray[np.float64],
) -> NDArray[np.float64]:
    """One step (6,); ``hold`` (6, 6), per plane, draws back by what it is ``away`` (6,).

    The little by which each of the planes leans that face one way is roughness, or an error: a
    voxel that one beam crossed knows its plane along the beam only, so the same beam a little
    further fits best where the sensor has not moved. Such planes fix the way they face, no more.
    """
    face, alike = main_face(matches)
    normals = matches.normals
    normals = np.where(alike[:, None], (normals @ face)[:, None] * face, normals)
    weights = kernel_weights(matches, alike)
    slopes = jacobian(arms, normals)
    weighted = slopes * weights[:, None]
    held = weights.sum() * hold
    gradient = weighted.T @ matches.distances + held @ away
    return -np.linalg.solve(weighted.T @ slopes + held, gradient)


def assess(
    surface: SurfaceMap, points: NDArray[np.float64], pose: rigid.Pose, *, finest: int = 0
) -> Alignment:
    """How well the map speaks for a pose of points (M, 3), sensor coordinates."""
    placed = rigid.transform(pose, points)
    matches = surface.match(placed, finest)
    close = np.abs(matches.distances) < SCORE_GATE_M
    if close.sum() < 6:
        return Alignment(pose, 0.0, 0.0, float("inf"), np.zeros((6, 6)))
    agreement = np.maximum(0.0, 1.0 - (matches.distances / SCORE_GATE_M) ** 2)
    rarity = _rarity(matches.normals)
    # Points without a plane (new space, clutter) count as the average point does.
    share = len(matches.rows) / max(len(points), 1)
    slopes = jacobian(placed[matches.rows] - pose[:3, 3], matches.normals)
    weights = kernel_weights(matches, main_face(matches)[1])
    information = (slopes * weights[:, None]).T @ slopes
    return Alignment(
        pose,
        score=share * float((rarity * agreement).sum() / rarity.sum()),
        overlap=float(close.sum()) / max(len(points), 1),
        residual_m=float(np.median(np.abs(matches.distances[close]))),
        information=information / len(matches.rows),
    )


def _rarity(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Leverage (M,) of each normal: large where few others point its way."""
    spread = normals.T @ normals / len(normals)
    inverse = np.linalg.inv(spread + 0.01 * np.eye(3))
    return np.einsum("ij,jk,ik->i", normals, inverse, normals)
