"""Trajectories survive writing and reading; what is no motion is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.io.poses import kitti_text, read_poses, tum_text

POSES = np.stack(
    [
        rigid.translation((500_000.001, 5_400_000.002, 300.003))
        @ rigid.exponential(np.random.default_rng(seed).normal(size=6) * 2)
        for seed in range(20)
    ]
)
STAMPS = 1_700_000_000.123456 + 0.1 * np.arange(20)


def test_kitti_rows_keep_every_digit(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(kitti_text(POSES))
    trajectory = read_poses(tmp_path / "a.txt")
    np.testing.assert_allclose(trajectory.world_from_sensor, POSES, rtol=0, atol=1e-9)
    assert trajectory.stamps is None


def test_tum_lines_keep_a_millimetre_at_utm(tmp_path: Path) -> None:
    (tmp_path / "a.tum").write_text(tum_text(POSES, STAMPS))
    trajectory = read_poses(tmp_path / "a.tum")
    np.testing.assert_allclose(trajectory.world_from_sensor, POSES, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(trajectory.stamps, STAMPS)


def test_rounded_rotations_are_made_whole(tmp_path: Path) -> None:
    rows = POSES[:, :3].reshape(20, 12).round(4)
    np.savetxt(tmp_path / "a.txt", rows, fmt="%.4f")
    poses = read_poses(tmp_path / "a.txt").world_from_sensor
    identity = poses[:, :3, :3] @ np.swapaxes(poses[:, :3, :3], 1, 2)
    np.testing.assert_allclose(identity, np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(poses, POSES, atol=1e-3)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1 2 3\n", "3 numbers a line"),
        ("", "no pose"),
        ("2 0 0 0 0 1 0 0 0 0 1 0\n", "no rigid motion"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0\n", "no rigid motion"),
        ("1 0 0 0 0 1 0 0 0 0 1 nan\n", "non-finite"),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n1 2 3\n", "lines of 3 and of 12"),
        ("0 1 2 3 0 0 0 2\n", "length 2, not 1"),
        ("a b c d e f g h\n", "no number"),
    ],
)
def test_what_is_no_trajectory_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(InputError, match=sentence):
        read_poses(tmp_path / "a.txt")
