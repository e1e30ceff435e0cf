"""Trajectories: absolute and relative pose errors.

Poses are (T, 4, 4) stacks, world_from_sensor, the true and the estimated one frame by frame. The
errors are plain arrays; composing is the caller's: `from_first` or `aligned` before
`absolute_errors`, the pairs of one's choice for `relative_errors`. Checked against the `evo`
package in the tests.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid

Poses = NDArray[np.float64]
Pairs = NDArray[np.int64]

DISTANCE_TOLERANCE = 0.1
"""A pair counts for a distance when it is off by at most this share; the ``evo`` package."""

_TIE_WEIGHT = 1e-9
"""Weight of the orientations beside the positions in `aligned`."""


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Errors of K poses, or of K motions between two poses.

    Attributes:
        translation_m: (K,) metres.
        rotation_rad: (K,) radians, 0..pi.
    """

    translation_m: NDArray[np.float64]
    rotation_rad: NDArray[np.float64]

    @classmethod
    def pool(cls, parts: Iterable[PoseErrors]) -> PoseErrors:
        """All errors of several trajectories; no part at all gives no errors."""
        known = [cls(np.zeros(0), np.zeros(0)), *parts]
        return cls(
            np.concatenate([part.translation_m for part in known]),
            np.concatenate([part.rotation_rad for part in known]),
        )

    def __len__(self) -> int:
        return len(self.translation_m)

    @property
    def translation(self) -> ErrorStatistics:
        """Statistics of the translation errors, metres."""
        return ErrorStatistics.of(self.translation_m)

    @property
    def rotation(self) -> ErrorStatistics:
        """Statistics of the rotation errors, radians."""
        return ErrorStatistics.of(self.rotation_rad)


@dataclass(frozen=True)
class ErrorStatistics:
    """What is said of a few errors, in their own unit; all NaN when there is none."""

    rmse: float
    mean: float
    median: float
    largest: float

    @classmethod
    def of(cls, errors: NDArray[Any]) -> ErrorStatistics:
        """Statistics of errors (K,)."""
        if len(errors) == 0:
            return cls(nan, nan, nan, nan)
        return cls(
            rmse=float(np.sqrt(np.mean(np.square(errors)))),
            mean=float(np.mean(errors)),
            median=float(np.median(errors)),
            largest=float(np.max(errors)),
        )


def from_first(poses: Poses) -> Poses:
    """The trajectory (T, 4, 4) seen from its own first pose, which becomes the identity."""
    return rigid.invert(poses[:1]) @ poses


def aligned(estimated: Poses, true: Poses) -> Poses:
    """The estimated trajectory, moved as a whole to lie on the true one as well as it can.

    Least squares over the positions, rotation and shift, no scale: Umeyama (PAMI 1991), Kabsch.
    On a straight drive, or a standing sensor, positions leave a rotation open (``evo`` refuses
    these); the orientations, with a weight of no weight otherwise, decide it.

    Args:
        estimated: (T, 4, 4).
        true: (T, 4, 4).

    Returns:
        (T, 4, 4) estimated poses in the true trajectory's world.
    """
    check_poses(estimated, true)
    true_mean, estimated_mean = true[:, :3, 3].mean(axis=0), estimated[:, :3, 3].mean(axis=0)
    true_arms, estimated_arms = true[:, :3, 3] - true_mean, estimated[:, :3, 3] - estimated_mean
    spread = float(np.sum(true_arms**2)) + _TIE_WEIGHT
    turns = np.einsum("tij,tkj->ik", true[:, :3, :3], estimated[:, :3, :3]) / len(true)
    left, _, right = np.linalg.svd(true_arms.T @ estimated_arms + _TIE_WEIGHT * spread * turns)
    proper = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    true_from_estimated = np.eye(4)
    true_from_estimated[:3, :3] = left @ proper @ right
    true_from_estimated[:3, 3] = true_mean - true_from_estimated[:3, :3] @ estimated_mean
    return true_from_estimated @ estimated


def absolute_errors(estimated: Poses, true: Poses) -> PoseErrors:
    """APE: how far each pose is off, as the poses stand; see `aligned` and `from_first`.

    Translation is the distance between the positions, rotation the angle between the
    orientations. Source: Sturm et al. (IROS 2012), as in ``evo``.
    """
    check_poses(estimated, true)
    return PoseErrors(
        translation_m=np.linalg.norm(estimated[:, :3, 3] - true[:, :3, 3], axis=1),
        rotation_rad=_angles(rigid.invert(estimated) @ true),
    )


def relative_errors(estimated: Poses, true: Poses, pairs: Pairs) -> PoseErrors:
    """RPE: how far the motion between two poses is off, for pairs (K, 2) of frame indices.

    Source: Sturm et al. (IROS 2012), as in ``evo``: error = true_motion⁻¹ · estimated_motion.
    """
    check_poses(estimated, true)
    first, second = pairs.reshape(-1, 2).T
    true_motions = rigid.invert(true[first]) @ true[second]
    estimated_motions = rigid.invert(estimated[first]) @ estimated[second]
    errors = rigid.invert(true_motions) @ estimated_motions
    return PoseErrors(np.linalg.norm(errors[:, :3, 3], axis=1), _angles(errors))


def pairs_by_frames(count: int, delta: int) -> Pairs:
    """All pairs (K, 2) of ``count`` frames that are ``delta`` apart; none when too few."""
    if delta < 1:
        raise InputError(f"frames {delta} apart are no pair")
    first = np.arange(max(count - delta, 0))
    return np.stack([first, first + delta], axis=1)


def pairs_by_distance(
    true: Poses, distance_m: float, tolerance: float = DISTANCE_TOLERANCE
) -> Pairs:
    """For each frame the later one nearest to a distance on along the true path: pairs (K, 2).

    Args:
        true: (T, 4, 4); the true path, so that all methods are scored on the same pairs.
        distance_m: Distance along the path, metres.
        tolerance: Pairs further off than this share of the distance are left out.
    """
    if distance_m <= 0:
        raise InputError(f"a distance of {distance_m} m makes no pairs")
    path = path_lengths(true)
    pairs = []
    for first in range(len(path) - 1):
        off = np.abs(path[first + 1 :] - path[first] - distance_m)
        nearest = int(np.argmin(off))
        if off[nearest] <= tolerance * distance_m:
            pairs.append((first, first + 1 + nearest))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def path_lengths(poses: Poses) -> NDArray[np.float64]:
    """(T,) metres gone up to each pose (T, 4, 4), along the path."""
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    return np.concatenate([np.zeros(min(len(poses), 1)), np.cumsum(steps)])


def _angles(motions: Poses) -> NDArray[np.float64]:
    if len(motions) == 0:
        return np.zeros(0)
    return Rotation.from_matrix(motions[:, :3, :3]).magnitude()


def check_poses(estimated: Poses, true: Poses) -> None:
    """Refuse what is not two finite, equally long (T, 4, 4) stacks of at least one pose.

    Raises:
        InputError: They are not.
    """
    if true.shape != estimated.shape or true.shape[1:] != (4, 4) or len(true) == 0:
        raise InputError(f"poses must be (T, 4, 4) stacks: {estimated.shape} and {true.shape}")
    if not np.isfinite(estimated).all() or not np.isfinite(true).all():
        raise InputError("poses must be finite")
