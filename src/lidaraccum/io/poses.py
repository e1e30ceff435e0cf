"""Trajectories in and out: KITTI rows and TUM lines, in full float64."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.io.columns import readable

KITTI_NUMBERS, TUM_NUMBERS = 12, 8
ORTHONORMAL_WITHIN = 1e-3


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of a file, in its order.

    Attributes:
        world_from_sensor: (T, 4, 4) float64.
        stamps: (T,) seconds of a TUM file, or None for KITTI rows.
    """

    world_from_sensor: NDArray[np.float64]
    stamps: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.world_from_sensor)


def read_poses(path: Path) -> Trajectory:
    """Read KITTI rows (12 numbers) or TUM lines (8 numbers), told apart by their count.

    Raises:
        InputError: Neither, non-finite, or rotations that are none.
    """
    rows = read_rows(path)
    width = rows.shape[1]
    if width == KITTI_NUMBERS:
        poses = np.tile(np.eye(4), (len(rows), 1, 1))
        poses[:, :3, :4] = rows.reshape(-1, 3, 4)
        return Trajectory(orthonormal(poses, path))
    if width == TUM_NUMBERS:
        return Trajectory(poses_of_tum(rows, path), rows[:, 0].copy())
    raise InputError(
        f"{path} has {width} numbers a line: poses have 12 (KITTI) or 8 (TUM)",
    )


def read_rows(path: Path) -> NDArray[np.float64]:
    """Numbers (T, columns) of a text file; ``#`` begins a comment, commas may separate."""
    with readable(path):
        try:
            lines = path.read_text().splitlines()
        except UnicodeDecodeError as error:
            raise InputError(f"{path} is not text") from error
    bodies = [line.split("#")[0].replace(",", " ").split() for line in lines]
    try:
        rows = [[float(word) for word in body] for body in bodies if body]
    except ValueError as error:
        raise InputError(f"{path} holds something that is no number: {error}") from error
    if not rows:
        raise InputError(f"{path} holds no pose")
    widths = {len(row) for row in rows}
    if len(widths) > 1:
        raise InputError(f"{path} has lines of {min(widths)} and of {max(widths)} numbers")
    numbers = np.array(rows)
    if not np.isfinite(numbers).all():
        raise InputError(f"{path} holds non-finite numbers")
    return numbers


def orthonormal(poses: NDArray[np.float64], path: Path) -> NDArray[np.float64]:
    """The poses (T, 4, 4) with the nearest true rotations.

    Raises:
        InputError: A rotation is further than 1e-3 from orthonormal, or a mirror.
    """
    rotations = poses[:, :3, :3]
    error = np.abs(rotations @ np.swapaxes(rotations, 1, 2) - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero((error > ORTHONORMAL_WITHIN) | (np.linalg.det(rotations) < 0))
    if len(bad):
        raise InputError(
            f"{path}: pose {bad[0]} is no rigid motion (rotation off by {error[bad[0]]:.2g})"
        )
    left, _, right = np.linalg.svd(rotations)
    nearest = poses.copy()
    nearest[:, :3, :3] = left @ right
    # Poses that are exact already keep their digits.
    exact = error < 1e-12
    nearest[exact] = poses[exact]
    return nearest


def poses_of_tum(rows: NDArray[np.float64], path: Path) -> NDArray[np.float64]:
    """Poses (T, 4, 4) of lines (T, 8): stamp, tx ty tz, qx qy qz qw."""
    quaternions = rows[:, 4:]
    norms = np.linalg.norm(quaternions, axis=1)
    bad = np.flatnonzero(np.abs(norms - 1.0) > ORTHONORMAL_WITHIN)
    if len(bad):
        raise InputError(f"{path}: quaternion {bad[0]} has length {norms[bad[0]]:.4g}, not 1")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = rotations_of_quaternions(quaternions / norms[:, None])
    poses[:, :3, 3] = rows[:, 1:4]
    return poses


def rotations_of_quaternions(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (T, 3, 3) of unit quaternions (T, 4) x, y, z, w."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_of_rotation(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit quaternion (4,) x, y, z, w of a rotation (3, 3).

    The eigenvector of Bar-Itzhack's symmetric matrix: no case distinction, stable everywhere.
    """
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] - r[1, 2]],
            [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2], r[0, 2] - r[2, 0]],
            [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)],
        ]
    )
    quaternion = np.linalg.eigh(k)[1][:, -1]
    return quaternion if quaternion[3] >= 0 else -quaternion


def match_stamps(
    trajectory: Trajectory, stamps: NDArray[np.float64], within_s: float, path: Path
) -> NDArray[np.float64]:
    """The pose (T, 4, 4) nearest in time to each frame's stamp (T,).

    Raises:
        InputError: A frame has no pose within ``within_s`` seconds.
    """
    assert trajectory.stamps is not None
    gaps = np.abs(trajectory.stamps[None, :] - stamps[:, None])
    nearest = gaps.argmin(axis=1)
    far = np.flatnonzero(gaps[np.arange(len(stamps)), nearest] > within_s)
    if len(far):
        raise InputError(
            f"{path}: {len(far)} of {len(stamps)} frames have no pose within {within_s:g} s, "
            f"the first is frame {far[0]}",
            hint="the stamps of poses and frames may count from different origins",
        )
    return trajectory.world_from_sensor[nearest]


def camera_calibration(path: Path) -> rigid.Pose:
    """KITTI's ``Tr`` of calib.txt: camera-0_from_velodyne (4, 4)."""
    with readable(path):
        lines = path.read_text().splitlines()
    for line in lines:
        key, _, body = line.partition(":")
        if key.strip() in ("Tr", "Tr_velo_to_cam"):
            try:
                numbers = np.array([float(word) for word in body.split()])
            except ValueError as error:
                raise InputError(f"{path}: Tr holds something that is no number") from error
            if numbers.size == KITTI_NUMBERS:
                motion = np.eye(4)
                motion[:3, :4] = numbers.reshape(3, 4)
                return orthonormal(motion[None], path)[0]
    raise InputError(f"{path} has no line Tr with 12 numbers")


def velodyne_poses(camera_poses: NDArray[np.float64], camera_from_sensor: rigid.Pose) -> Any:
    """Camera-0 poses (T, 4, 4) as poses of the sensor, the world being its first place's axes."""
    return rigid.invert(camera_from_sensor) @ camera_poses @ camera_from_sensor


def kitti_text(poses: NDArray[np.float64]) -> str:
    """Poses (T, 4, 4) as KITTI rows, every digit of float64 kept."""
    rows = np.asarray(poses, dtype=np.float64)[:, :3, :4].reshape(-1, KITTI_NUMBERS)
    return "".join(" ".join(f"{number:.17g}" for number in row) + "\n" for row in rows)


def tum_text(poses: NDArray[np.float64], stamps: NDArray[np.float64]) -> str:
    """Poses (T, 4, 4) with stamps (T,) as TUM lines, every digit of float64 kept."""
    lines = ["# timestamp tx ty tz qx qy qz qw\n"]
    for pose, stamp in zip(poses, stamps, strict=True):
        numbers = [stamp, *pose[:3, 3], *quaternion_of_rotation(pose[:3, :3])]
        lines.append(" ".join(f"{number:.17g}" for number in numbers) + "\n")
    return "".join(lines)
