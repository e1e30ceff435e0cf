"""A view knows what its rays passed, what they met, and what it cannot know."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.geometry.visibility import RangeView, elevation_gap


def sphere(radius: float, beams: int = 40, columns: int = 900) -> np.ndarray:
    """Hits on a sphere about the sensor, elevations -20..20 degrees."""
    elevation = np.radians(np.linspace(-20, 20, beams))
    azimuth = np.radians(np.arange(columns) * 360 / columns)
    up, around = np.meshgrid(elevation, azimuth, indexing="ij")
    rays = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], -1)
    return radius * rays.reshape(-1, 3)


def at(radius: float, azimuth_deg: float, elevation_deg: float = 1.0) -> np.ndarray:
    up, around = np.radians(elevation_deg), np.radians(azimuth_deg)
    ray = [np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)]
    return radius * np.array([ray])


@pytest.mark.parametrize("columns", [360, 900, 2000])
@pytest.mark.parametrize("azimuth", [-180.0, -91.3, 0.0, 77.0, 179.99])
def test_rays_pass_what_is_before_the_wall(columns: int, azimuth: float) -> None:
    view = RangeView(sphere(20.0, columns=columns), np.radians(40 / 39))
    assert view.look(at(10.0, azimuth)).through.all()
    assert not view.look(at(10.0, azimuth)).met.any()
    assert view.look(at(20.1, azimuth)).met.all()
    assert not view.look(at(20.1, azimuth)).through.any()


def test_nothing_is_known_behind_the_wall_or_where_no_ray_went() -> None:
    view = RangeView(sphere(20.0), np.radians(40 / 39))
    for places in (at(25.0, 10.0), at(10.0, 10.0, elevation_deg=60.0)):
        sighting = view.look(places)
        assert not sighting.through.any()
        assert not sighting.met.any()


def test_a_thin_pole_hides_what_is_behind_it() -> None:
    pole = np.concatenate([at(5.0, 30.0, elevation) for elevation in np.linspace(-20, 20, 40)])
    view = RangeView(np.concatenate([sphere(20.0), pole]), np.radians(40 / 39))
    assert not view.look(at(10.0, 30.0)).through.any()
    assert view.look(at(10.0, 35.0)).through.all()


def test_turning_sensor_and_places_together_changes_nothing() -> None:
    rng = np.random.default_rng(2)
    places = rng.uniform(-18, 18, (400, 3)) * (1, 1, 0.2)
    turn = rigid.exponential(np.array([0, 0, np.radians(24.0), 0, 0, 0]))
    cloud = sphere(15.0)
    view = RangeView(cloud, np.radians(40 / 39))
    turned = RangeView(rigid.transform(turn, cloud), np.radians(40 / 39))
    same = view.look(places).through == turned.look(rigid.transform(turn, places)).through
    assert same.mean() > 0.99


def test_a_view_of_nothing_knows_nothing() -> None:
    sighting = RangeView(np.zeros((0, 3)), 0.01).look(at(5.0, 0.0))
    assert not sighting.through.any()
    assert not sighting.met.any()


@pytest.mark.parametrize("beams", [16, 32, 64])
def test_the_gap_between_beams_is_measured(beams: int) -> None:
    expected = 40 / (beams - 1)
    assert np.degrees(elevation_gap(sphere(20.0, beams))) == pytest.approx(expected, rel=0.1)


def test_the_gap_of_nothing_is_coarse() -> None:
    assert elevation_gap(np.zeros((0, 3))) > np.radians(1.0)


def test_specks_in_the_air_hide_nothing() -> None:
    rng = np.random.default_rng(4)
    wall = sphere(20.0)
    specks = rng.random(len(wall)) < 0.08
    clutter = wall[specks] * rng.uniform(0.06, 0.2, (int(specks.sum()), 1))
    view = RangeView(np.concatenate([wall[~specks], clutter]), np.radians(40 / 39))
    places = np.concatenate([at(10.0, azimuth) for azimuth in np.arange(0.0, 360.0, 3.0)])
    assert view.look(places).through.mean() > 0.8


def test_a_wide_thing_close_by_hides_what_is_behind_it() -> None:
    wall = sphere(20.0)
    near = np.abs(np.arctan2(wall[:, 1], wall[:, 0])) < np.radians(5)
    view = RangeView(np.where(near[:, None], 0.2 * wall, wall), np.radians(40 / 39))
    behind = view.look(at(10.0, 0.0))
    assert not behind.through.any()
    assert not behind.met.any()
    assert view.look(at(4.0, 0.0)).met.all()


def test_the_viewpoint_is_where_one_looks_from() -> None:
    mount = np.array([0.4, -0.1, 1.9])
    places = np.concatenate([at(10.0, 40.0), at(20.1, 40.0), at(25.0, 40.0)])
    seen = RangeView(sphere(20.0), np.radians(40 / 39)).look(places)
    moved = RangeView(sphere(20.0) + mount, np.radians(40 / 39), mount).look(places + mount)
    np.testing.assert_array_equal(moved.through, seen.through)
    np.testing.assert_array_equal(moved.met, seen.met)
