"""The ground under a frame: level whatever the mount, low whatever stands on it."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.geometry.ground import STRAY_M, estimate_ground


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


def mirrored(points: np.ndarray, mount_m: float) -> np.ndarray:
    """What a wet road shows of things (N, 3) that stand on it, sensor at the origin."""
    return points * [1, 1, -1] - [0, 0, 2 * mount_m]


def test_the_mirror_image_of_a_vehicle_in_the_road_digs_no_hole() -> None:
    """Seen in real frames: images of a van and a cyclist, several cells wide, metres deep."""
    rng = np.random.default_rng(0)
    mount_m = 1.8
    road, _ = street()
    road[:, 2] -= mount_m
    van = rng.uniform([9, -3, 0.1 - mount_m], [14, 0, 2 - mount_m], (800, 3))
    cyclist = rng.uniform([-7, 3, -mount_m], [-5, 4, -0.1], (300, 3))
    seen = np.concatenate([road, van, cyclist, mirrored(van, mount_m), mirrored(cyclist, mount_m)])
    ground = estimate_ground(seen)
    above = ground.height_above(rigid.transform(ground.level_from_sensor, seen))
    off = np.abs(above[: len(road)][on_road(road)])
    assert np.percentile(off, 75) < 0.15
    assert off.max() < STRAY_M  # images less deep than that are still taken for ground
    off = np.abs(above[len(road) :][: len(van)] - van[:, 2] - mount_m)
    assert off.max() < STRAY_M


def test_thin_mirror_images_dig_no_hole() -> None:
    """A few points a cell, as a car beyond a wet road leaves, over many cells that hold no road."""
    rng = np.random.default_rng(0)
    mount_m = 1.8
    road, _ = street()
    road[:, 2] -= mount_m
    hidden = (road[:, 0] > 8) & (road[:, 1] < -2) & (road[:, 1] > -9)
    images = rng.uniform([8, -9, -4 - mount_m], [18, -2, -0.2 - mount_m], (80, 3))
    images = images[images[:, 0] * mount_m / -images[:, 2] < 8]  # off the road that is in sight
    ground = estimate_ground(np.concatenate([road[~hidden], images]))
    above = ground.height_above(rigid.transform(ground.level_from_sensor, road))
    assert np.abs(above[on_road(road)]).max() < 0.3


def test_mirror_images_of_a_dense_sensor_dig_no_hole() -> None:
    """Twelve times the rays bring twelve times the images: few still beside the road's."""
    rng = np.random.default_rng(0)
    mount_m = 1.8
    xy = rng.uniform(-30, 30, (200_000, 2))
    hidden = (xy[:, 0] > 3) & (xy[:, 0] < 12) & (xy[:, 1] < -2) & (xy[:, 1] > -14)
    road = np.column_stack([xy[~hidden], rng.normal(-mount_m, 0.02, np.count_nonzero(~hidden))])
    images = rng.uniform([3, -14, -4 - mount_m], [12, -2, -0.4 - mount_m], (130, 3))
    ground = estimate_ground(np.concatenate([road, images]))
    under = np.column_stack([xy[hidden], np.full(np.count_nonzero(hidden), -mount_m)])
    above = ground.height_above(rigid.transform(ground.level_from_sensor, under))
    assert np.abs(above).max() < 0.3


def test_cars_in_a_row_that_hide_the_ground_do_not_raise_it() -> None:
    """Of the second row only upper parts are seen, and nothing of what it stands on."""
    rng = np.random.default_rng(0)
    xy = rng.uniform(-40, 40, (40_000, 2))
    behind = (xy[:, 1] > 4) & (xy[:, 1] < 9) & (np.abs(xy[:, 0]) < 20)
    lot = np.column_stack([xy[~behind], np.zeros(np.count_nonzero(~behind))])
    first = rng.uniform([-20, 4, 0.2], [20, 5.8, 1.5], (4000, 3))
    second = rng.uniform([-20, 7, 0.7], [20, 8.8, 1.5], (1000, 3))
    ground = estimate_ground(np.concatenate([lot, first, second]) - [0, 0, 1.8])
    under = np.column_stack([xy[behind], np.full(np.count_nonzero(behind), -1.8)])
    above = ground.height_above(rigid.transform(ground.level_from_sensor, under))
    assert np.abs(above).max() < 0.3
    assert np.percentile(np.abs(above), 75) < 0.15


def test_a_slope_that_begins_beyond_a_crest_is_ground() -> None:
    """Far below the plane, but no ray to it passes through the road."""
    rng = np.random.default_rng(0)
    mount_m = 1.8
    xy = rng.uniform(-40, 40, (40_000, 2))
    crest_m = 8.0
    fall = 0.15 * np.maximum(xy[:, 0] - crest_m, 0)
    points = np.column_stack([xy, -fall - mount_m])
    ground = estimate_ground(points)
    above = ground.height_above(rigid.transform(ground.level_from_sensor, points))
    inner = np.abs(points[:, :2]).max(axis=1) < 30
    assert np.percentile(np.abs(above[inner]), 99) < 0.5


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


def test_single_echoes_from_far_below_are_no_ground() -> None:
    """A crowded wet street: the road shows in a few cells, strays below it in many."""
    rng = np.random.default_rng(5)
    road = np.column_stack([rng.uniform(-6, 6, (1200, 2)), rng.normal(-1.6, 0.02, 1200)])
    things = rng.uniform((-24, -24, -1.2), (24, 24, 1.5), (400, 3)).repeat(25, axis=0)
    crowd = things + rng.uniform(0, 0.8, (10_000, 3))
    strays = rng.uniform((-24, -24, -12.0), (24, 24, -2.2), (250, 3))
    ground = estimate_ground(np.concatenate([road, crowd, strays]))
    assert ground.level_from_sensor[2, 3] == pytest.approx(1.6, abs=0.1)
