"""Poses of Argoverse 2 come oftener than sweeps, but not always at their stamps."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from lidaraccum.errors import InputError
from lidaraccum.io.driving.argoverse2 import poses_at, stamp_of

EPOCH_NS = 1_533_151_603_000_000_000


@pytest.fixture(scope="module")
def poses(logs: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Poses of the made-up street, every 50 ms from -50 to 350 ms."""
    source = logs.write("argoverse2", tmp_path_factory.mktemp("argoverse2"))
    return source.root / source.name / "city_SE3_egovehicle.feather"


def test_between_two_poses_is_the_way_between(poses: Path, logs: ModuleType) -> None:
    millis = np.array([-50, 0, 17, 99, 350])
    found = poses_at(EPOCH_NS + 1_000_000 * millis, poses)
    np.testing.assert_allclose(found, [logs.vehicle_at(1e-3 * at) for at in millis], atol=1e-9)


@pytest.mark.parametrize("millis", [-51, 351])
def test_a_sweep_without_a_pose_is_refused(poses: Path, millis: int) -> None:
    with pytest.raises(InputError, match="no pose about"):
        poses_at(np.array([EPOCH_NS + 1_000_000 * millis]), poses)


def test_a_sweep_is_called_by_its_stamp() -> None:
    assert stamp_of(Path("15970913559644000.feather")) == 15970913559644000
    with pytest.raises(InputError, match=r"copy of 1\.feather"):
        stamp_of(Path("copy of 1.feather"))
