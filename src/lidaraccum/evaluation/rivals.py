"""Odometry that a user might take instead, on the same frames: how long it takes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidaraccum.data.frame import Frame
from lidaraccum.errors import MissingDependencyError

MAX_RANGE_M = 100.0
VOXEL_M = 0.5
GATE_M = 1.0
NORMAL_NEIGHBOURS = 20


@dataclass(frozen=True)
class Rival:
    """Another odometry.

    Attributes:
        name: For tables.
        run: Registers frames in order; returns the seconds it took, imports not counted.
    """

    name: str
    run: Callable[[Sequence[Frame]], float]


def run_kiss_icp(frames: Sequence[Frame]) -> float:
    """KISS-ICP (Vizzo et al., RA-L 2023) in its defaults; deskewing where the points have times.

    Raises:
        MissingDependencyError: It is not installed.
    """
    try:
        from kiss_icp.config.parser import load_config
        from kiss_icp.kiss_icp import KissICP
    except ImportError as error:
        raise MissingDependencyError("kiss-icp is not installed", hint=INSTALL) from error
    config = load_config(None)
    config.data.deskew = all(frame.time_offset is not None for frame in frames)
    odometry = KissICP(config)
    start = time.perf_counter()
    for frame in frames:
        odometry.register_frame(frame.points[frame.returned].astype(np.float64), _sweep(frame))
    return time.perf_counter() - start


def _sweep(frame: Frame) -> Any:
    """Times of a sweep from 0 to 1, as KISS-ICP wants them; empty where there are none."""
    if frame.time_offset is None:
        return np.zeros(0)
    times = np.asarray(frame.time_offset[frame.returned], dtype=np.float64)
    return (times - times.min()) / max(float(np.ptp(times)), 1e-9)


def run_open3d(frames: Sequence[Frame]) -> float:
    """Open3D's point-to-plane ICP from frame to frame, started at constant velocity.

    Raises:
        MissingDependencyError: Open3D is not installed.
    """
    try:
        import open3d
    except (ImportError, OSError) as error:
        raise MissingDependencyError("open3d cannot be opened", hint=INSTALL) from error
    registration = open3d.pipelines.registration
    start = time.perf_counter()
    previous, step = None, np.eye(4)
    for frame in frames:
        cloud = open3d.geometry.PointCloud()
        near = frame.returned & (frame.ranges < MAX_RANGE_M)
        cloud.points = open3d.utility.Vector3dVector(frame.points[near].astype(np.float64))
        cloud = cloud.voxel_down_sample(VOXEL_M)
        cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(NORMAL_NEIGHBOURS))
        if previous is not None:
            plane = registration.TransformationEstimationPointToPlane()
            found = registration.registration_icp(cloud, previous, GATE_M, step, plane)
            step = np.asarray(found.transformation)
        previous = cloud
    return time.perf_counter() - start


INSTALL = "the extra 'benchmark' brings it"
KISS_ICP = Rival("kiss-icp", run_kiss_icp)
OPEN3D = Rival("open3d point-to-plane", run_open3d)
RIVALS = (KISS_ICP, OPEN3D)
