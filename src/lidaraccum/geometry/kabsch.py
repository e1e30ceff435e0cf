"""The rigid motion between two sets of points that belong together one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.geometry.rigid import Pose


def kabsch(source: NDArray[Any], target: NDArray[Any], weights: NDArray[Any] | None = None) -> Pose:
    """The motion (4, 4) that takes source (N, 3) to target (N, 3) with least weighted squares.

    Where the points leave the rotation open (fewer than three, or all on one line), it is one of
    the best ones.

    Raises:
        InputError: No weight at all, or arrays of different lengths.

    Source: Kabsch 1976, with Umeyama's sign against reflections (1991).
    """
    source_mean, target_mean, covariance = _moments(source, target, weights)
    left, _, right = np.linalg.svd(covariance)
    sign = np.linalg.det(right.T @ left.T)
    rotation = right.T @ np.diag([1.0, 1.0, sign]) @ left.T
    return _motion(rotation, source_mean, target_mean)


def planar_kabsch(
    source: NDArray[Any], target: NDArray[Any], weights: NDArray[Any] | None = None
) -> Pose:
    """As `kabsch`, turning about the upright axis only.

    Raises:
        InputError: As `kabsch`.
    """
    source_mean, target_mean, covariance = _moments(source, target, weights)
    angle = np.arctan2(covariance[0, 1] - covariance[1, 0], covariance[0, 0] + covariance[1, 1])
    cosine, sine = np.cos(angle), np.sin(angle)
    rotation = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return _motion(rotation, source_mean, target_mean)


def _moments(
    source: NDArray[Any], target: NDArray[Any], weights: NDArray[Any] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    source, target = np.asarray(source, np.float64), np.asarray(target, np.float64)
    share = np.ones(len(source)) if weights is None else np.asarray(weights, np.float64)
    if source.shape != target.shape or share.shape != (len(source),):
        raise InputError(f"{source.shape} and {target.shape} points, {share.shape} weights")
    if not share.sum() > 0:
        raise InputError("a rigid motion takes points with weight")
    share = share / share.sum()
    source_mean, target_mean = share @ source, share @ target
    covariance = (source - source_mean).T @ ((target - target_mean) * share[:, None])
    return source_mean, target_mean, covariance


def _motion(
    rotation: NDArray[np.float64],
    source_mean: NDArray[np.float64],
    target_mean: NDArray[np.float64],
) -> Pose:
    motion = np.eye(4)
    motion[:3, :3] = rotation
    motion[:3, 3] = target_mean - rotation @ source_mean
    return motion
