"""Heights are above the ground, wherever the ground is."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry.terrain import estimate_terrain


def ground(slope: float = 0.0, drop: float = -1.7) -> np.ndarray:
    """A dense square of ground, rising along x."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-40, 40, (60000, 3))
    points[:, 2] = drop + slope * points[:, 0] + rng.normal(0, 0.02, len(points))
    return points


def box(centre: tuple[float, float], bottom: float) -> np.ndarray:
    """Points on and in a car-sized box."""
    rng = np.random.default_rng(1)
    return rng.uniform((-2, -0.9, 0.2), (2, 0.9, 1.5), (800, 3)) + np.array([*centre, bottom])


@pytest.mark.parametrize("slope", [0.0, 0.05, -0.08])
@pytest.mark.parametrize("drop", [-1.7, 0.0, 2.0])
def test_ground_is_at_height_0_and_boxes_stand_on_it(slope: float, drop: float) -> None:
    floor = ground(slope, drop)
    thing = box((10.0, 5.0), drop + slope * 10.0)
    terrain = estimate_terrain(np.concatenate([floor, thing]))
    assert np.quantile(np.abs(terrain.height_above(floor)), 0.95) < 0.15
    assert np.median(terrain.height_above(thing)) == pytest.approx(0.85, abs=0.2)


def test_a_roof_that_hides_the_ground_is_no_ground() -> None:
    floor = ground()
    under = np.abs(floor[:, :2] - (10, 5)) < (2.2, 1.1)
    roof = box((10.0, 5.0), -1.7)
    cloud = np.concatenate([floor[~under.all(axis=1)], roof])
    assert estimate_terrain(cloud).height_above(roof).max() > 1.3


def test_a_stray_echo_from_below_does_not_pull_the_ground_down() -> None:
    floor = ground()
    cloud = np.concatenate([floor, [[12.3, 4.5, -6.0]]])
    near = np.hypot(floor[:, 0] - 12.3, floor[:, 1] - 4.5) < 2
    assert np.abs(estimate_terrain(cloud).height_above(floor[near])).max() < 0.3


def test_order_does_not_matter_and_nothing_has_a_ground() -> None:
    floor = ground()
    shuffled = np.random.default_rng(3).permutation(floor)
    assert (estimate_terrain(floor).heights == estimate_terrain(shuffled).heights).all()
    assert (estimate_terrain(np.zeros((0, 3))).heights == 0).all()


def test_a_van_close_beside_the_sensor_hides_its_ground_but_is_none() -> None:
    floor = ground()
    blind = np.hypot(floor[:, 0], floor[:, 1]) < 4.0
    behind = (np.abs(floor[:, 0]) < 1.2 * floor[:, 1]) & (floor[:, 1] > 2.5)
    rng = np.random.default_rng(2)
    side = rng.uniform((-3.0, 2.5, 0.3), (3.0, 2.6, 2.2), (3000, 3)) + np.array([0, 0, -1.7])
    terrain = estimate_terrain(np.concatenate([floor[~blind & ~behind], side]))
    np.testing.assert_allclose(terrain.height_above(side), side[:, 2] + 1.7, atol=0.15)
