"""The ground under a frame: level whatever the mount, low whatever stands on it."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.geometry.ground import estimate_ground


def street(seed: int = 0, slope: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) points of a road, poles and walls, and their heights (N,) above the road."""
    rng = np.random.default_rng(seed)
    radius = 40 * np.sqrt(rng.random(12_000))
    angle = rng.uniform(0, 2 * np.pi, 12_000)
    xy = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    height = np.where(np.abs(xy[:, 1]) > 8, rng.uniform(0, 4, 12_000), 0.0)
    height += np.abs(rng.normal(0, 0.01, 12_000))
    return np.column_stack([xy, slope * xy[:, 0] + height]), height


def on_road(points: np.ndarray) -> np.ndarray:
    """(N,) True for points a cell and a half away from the walls and the road's ends."""
    return (np.abs(points[:, 1]) < 4) & (np.abs(points[:, 0]) < 30)


@pytest.mark.parametrize("mount_m", [-2.5, -1.7, 0.0])
@pytest.mark.parametrize("tilt_deg", [0.0, 3.0, -12.0])
@pytest.mark.parametrize("slope", [0.0, 0.08])
def test_height_does_not_depend_on_mount_tilt_or_slope(
    mount_m: float, tilt_deg: float, slope: float
) -> None:
    points, height = street(slope=slope)
    tilt = rigid.exponential(np.deg2rad([tilt_deg, 0.5 * tilt_deg, 0, 0, 0, 0]))
    points = rigid.transform(rigid.translation((0, 0, mount_m)) @ tilt, points)
    ground = estimate_ground(points)
    above = ground.height_above(rigid.transform(ground.level_from_sensor, points))
    road = on_road(street(slope=slope)[0])
    assert np.abs(above - height)[road].max() < 0.15
    assert np.percentile(np.abs(above - height), 90) < 0.5


def test_levelling_is_a_rigid_motion_without_a_turn_about_z() -> None:
    points, _ = street(slope=0.1)
    level = estimate_ground(points).level_from_sensor
    np.testing.assert_allclose(level[:3, :3] @ level[:3, :3].T, np.eye(3), atol=1e-12)
    assert abs(level[1, 0] - level[0, 1]) < 1e-12


def test_a_stray_echo_from_below_digs_no_hole() -> None:
    points, _ = street()
    holed = np.concatenate([points, [[3.0, 1.0, -6.0], [-10.0, 2.0, -3.0]]])
    ground = estimate_ground(holed)
    above = ground.height_above(rigid.transform(ground.level_from_sensor, points))
    road = on_road(points)
    assert np.abs(above[road]).max() < 0.15


def test_the_order_of_points_does_not_matter() -> None:
    points, _ = street()
    shuffled = np.random.default_rng(1).permutation(points)
    first, second = estimate_ground(points), estimate_ground(shuffled)
    np.testing.assert_array_equal(first.heights, second.heights)
    np.testing.assert_array_equal(first.level_from_sensor, second.level_from_sensor)


@pytest.mark.parametrize("count", [1, 2, 20])
def test_hardly_any_points_leave_the_sensor_level(count: int) -> None:
    points = np.random.default_rng(0).normal(0, 1, (count, 3))
    ground = estimate_ground(points)
    assert np.isfinite(ground.heights).all()
    np.testing.assert_allclose(ground.level_from_sensor[:3, :3], np.eye(3), atol=0.5)
