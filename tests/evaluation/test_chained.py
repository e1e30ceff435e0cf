"""Chained poses: right on a clean drive, and every pair counts."""

from __future__ import annotations

from typing import Any

import numpy as np

from lidaraccum.data.frame import Frame
from lidaraccum.evaluation.chained import chained_poses
from lidaraccum.registration.settings import RegistrationSettings


def test_a_chain_follows_a_clean_drive(drive: Any) -> None:
    frames = [Frame(points, stamp=0.1 * index) for index, points in enumerate(drive.frames[:4])]
    true = drive.first_from_frame[:4]
    found = chained_poses(frames, true, RegistrationSettings())
    assert found.shape == (4, 4, 4)
    np.testing.assert_array_equal(found[0], true[0])
    assert np.abs(found - true)[:, :3, 3].max() < 0.1
    assert np.abs(found - true)[1:, :3, 3].max() > 0
