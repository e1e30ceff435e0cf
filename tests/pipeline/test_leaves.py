"""A body has a surface, leaves have none: what long things that stand are made of."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.geometry import rigid
from lidaraccum.pipeline.leaves import Leaves, roughness

Array = NDArray[np.float64]


def body(noise_m: float = 0.02, spacing_m: float = 0.06, length_m: float = 4.2) -> Array:
    """Two sides and the roof of a rounded box, as a sensor beside it sees them."""
    along = np.arange(-length_m / 2, length_m / 2, spacing_m)
    across = np.arange(-0.9, 0.9, spacing_m)
    up = np.arange(0.3, 1.5, spacing_m)
    side = np.stack(np.meshgrid(along, [-0.9], up), -1).reshape(-1, 3)
    end = np.stack(np.meshgrid([-length_m / 2], across, up), -1).reshape(-1, 3)
    roof = np.stack(np.meshgrid(along, across, [1.5]), -1).reshape(-1, 3)
    points = np.concatenate([side, end, roof])
    return points + np.random.default_rng(0).normal(0, noise_m, points.shape)


def bush(depth_m: float = 0.5, count: int = 2500) -> Array:
    """Leaves in the outer decimetres of a body of a car's size."""
    rng = np.random.default_rng(1)
    way = rng.normal(0, 1, (count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    radii = np.array([2.1, 1.2, 0.8])
    points = way * (radii - depth_m * rng.uniform(0, 1, (count, 1)))
    return points[points[:, 1] < 0.2] + [0, 0, 0.8]


@pytest.mark.parametrize("noise_m", [0.0, 0.02, 0.035])
def test_a_body_is_no_leaves_however_the_sensor_rustles(noise_m: float) -> None:
    assert not Leaves().are_all_of(1, body(noise_m))


@pytest.mark.parametrize("depth_m", [0.4, 0.8])
def test_what_scatters_over_decimetres_is_leaves(depth_m: float) -> None:
    assert Leaves().are_all_of(1, bush(depth_m))


def test_roughness_does_not_depend_on_where_it_is_seen_from() -> None:
    pose = rigid.exponential(np.array([0.0, 0.0, 0.7, 12.0, -3.0, 0.5]))
    for points in (body(), bush()):
        here, there = roughness(points), roughness(rigid.transform(pose, points))
        assert here == pytest.approx(there, abs=0.01)


def test_many_points_of_one_place_tell_no_more_than_few() -> None:
    """A sensor's noise at close range is no texture."""
    dense = body(noise_m=0.02, spacing_m=0.015)
    assert roughness(dense) == pytest.approx(roughness(body(noise_m=0.02)), abs=0.01)


def test_what_is_short_or_thinly_seen_is_not_judged() -> None:
    assert not Leaves().are_all_of(1, bush() * [0.4, 1.0, 1.0])
    assert not Leaves().are_all_of(1, bush()[::200])
    assert roughness(bush()[::200]) is None


def test_what_was_leaves_from_one_place_is_leaves_from_the_next() -> None:
    leaves = Leaves()
    assert leaves.are_all_of(7, bush())
    assert leaves.are_all_of(7, bush()[:30]), "of which nothing can be told"
    assert not leaves.are_all_of(8, bush()[:10]), "another object"
    assert leaves.are_all_of(9, bush())
    for _ in range(5):
        leaves.are_all_of(9, body())
    assert not leaves.are_all_of(9, bush()[:30]), "it was no leaves most of the time"
