"""The poses that belong to the frames of a layout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.io.layouts import Layout
from lidaraccum.io.poses import camera_calibration, match_stamps, read_poses, velodyne_poses
from lidaraccum.io.timing import Timing


def sensor_poses(path: Path, layout: Layout, timing: Timing, count: int) -> NDArray[np.float64]:
    """Poses (T, 4, 4), world_from_sensor, of a file, for ``count`` frames on disk.

    TUM lines of another number are matched to the frames by their stamps, within half a period.
    KITTI's own, found beside the frames with a calib.txt, are the camera's and are moved to the
    sensor. Otherwise the file's own number of poses is given, for the caller to check.

    Raises:
        InputError: The file holds no trajectory, or a frame has no pose near its stamp.
    """
    trajectory = read_poses(path)
    stamps = timing.stamps
    if trajectory.stamps is not None and len(trajectory) != count:
        if stamps is None:
            stamps = timing.period_s * np.arange(count, dtype=np.float64)
        return match_stamps(trajectory, stamps, timing.period_s / 2, path)
    poses, found = trajectory.world_from_sensor, layout.poses_file
    is_own = found is not None and found.resolve() == path.resolve()
    if is_own and layout.calibration is not None:
        return velodyne_poses(poses, camera_calibration(layout.calibration))
    return poses
