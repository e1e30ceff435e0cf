"""Poses chained from frame to frame, the ablation that the paper's direct poses beat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid
from lidaraccum.registration.odometry import register
from lidaraccum.registration.settings import RegistrationSettings


def chained_poses(
    frames: Sequence[Frame], poses: NDArray[np.float64], settings: RegistrationSettings
) -> NDArray[np.float64]:
    """Poses (T, 4, 4), world_from_sensor, of frames of which each saw only the one before it.

    Each pair is registered alone, started from the poses (T, 4, 4) that the map gave, so that
    nothing is compared but the map with the chain.
    """
    refining = replace(settings, poses_mode="refine")
    chain = [poses[0]]
    for pair, starts in zip(pairwise(frames), pairwise(poses), strict=True):
        earlier, later = register(iter(pair), refining, np.stack(starts))
        step = rigid.invert(earlier.world_from_sensor) @ later.world_from_sensor
        chain.append(chain[-1] @ step)
    return np.stack(chain)
