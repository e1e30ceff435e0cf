"""Poses as the data sets write them: a translation and a quaternion, w first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.io.poses import ORTHONORMAL_WITHIN, rotations_of_quaternions

Array = NDArray[np.float64]


def poses_of_parts(
    translations: Sequence[Any] | NDArray[Any],
    quaternions: Sequence[Any] | NDArray[Any],
    path: Path,
) -> Array:
    """Poses (M, 4, 4) of translations (M, 3), metres, and quaternions (M, 4), w x y z.

    Raises:
        InputError: Other shapes, non-finite numbers, or quaternions that are not of length 1.
    """
    count = len(translations)
    try:
        places = np.array(translations, dtype=np.float64).reshape(count, 3)
        turns = np.array(quaternions, dtype=np.float64).reshape(count, 4)
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: a pose is no translation and quaternion: {error}") from error
    lengths = np.linalg.norm(turns, axis=1)
    bad = np.flatnonzero(
        ~(np.abs(lengths - 1.0) < ORTHONORMAL_WITHIN) | ~np.isfinite(places).all(axis=1)
    )
    if len(bad):
        raise InputError(
            f"{path}: pose {bad[0]} is none (translation {places[bad[0]].tolist()}, quaternion of "
            f"length {lengths[bad[0]]:.4g})"
        )
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = rotations_of_quaternions((turns / lengths[:, None])[:, [1, 2, 3, 0]])
    poses[:, :3, 3] = places
    return poses
