"""Close traffic that moves along: poses must follow what stands, though most of it moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid
from lidaraccum.registration.odometry import register

AHEAD_AND_BESIDE = ((8.0, 0.0), (-8.0, 0.0), (0.0, 3.6), (0.0, -3.6))
HALF_TRUCK = (2.2, 1.0)
FLOOR_Z, ROOF_Z = -1.7, 0.9


def in_convoy(world: Any, overtaking_m: float) -> tuple[list[Frame], np.ndarray, float]:
    """Frames among trucks that gain on the sensor, the true poses, the trucks' share of obstacles.

    Args:
        world: The fixture.
        overtaking_m: By how much in each frame.
    """
    houses = world.street()
    poses = rigid.exponentials(np.array([[0, 0, 0, 1.0, 0, 0]]), np.arange(5))
    frames, shares = [], []
    for index, pose in enumerate(poses):
        places = np.add(AHEAD_AND_BESIDE, [pose[0, 3] + overtaking_m * index, 0])
        low = np.hstack([places - HALF_TRUCK, np.full((4, 1), FLOOR_Z)])
        high = np.hstack([places + HALF_TRUCK, np.full((4, 1), ROOF_Z)])
        scene = world.Street(np.vstack([houses.low, low]), np.vstack([houses.high, high]))
        points = world.sensor.sweep(scene, pose, np.zeros(6)).points
        standing = points[points[:, 2] > FLOOR_Z + 0.3]
        there = standing[:, None] + pose[:3, 3]
        on_truck = ((there > low - 0.05) & (there < high + 0.05)).all(axis=2).any(axis=1)
        shares.append(on_truck.mean())
        noise = np.random.default_rng(index).normal(0, 0.015, points.shape)
        frames.append(Frame((points + noise).astype(np.float32), stamp=world.interval_s * index))
    return frames, poses, float(np.mean(shares))


@pytest.mark.parametrize("overtaking_m", [0.0, 0.3])
def test_poses_hold_though_most_of_what_stands_up_moves(world: Any, overtaking_m: float) -> None:
    frames, poses, moving = in_convoy(world, overtaking_m)
    assert moving > 0.8
    registered = list(register(frames))
    assert not any(frame.quality.doubts for frame in registered)
    away = [one.world_from_sensor[:3, 3] for one in registered] - poses[:, :3, 3]
    assert np.linalg.norm(away, axis=1).max() < 0.03
