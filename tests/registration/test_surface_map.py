"""Laws of the local map."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.registration.surface_map import SurfaceMap

RANDOM = np.random.default_rng(0)
FLOOR = np.column_stack([RANDOM.uniform(-20, 20, (20_000, 2)), RANDOM.normal(-1.8, 0.01, 20_000)])
TURNED = rigid.exponential(np.array([0.1, -0.05, 0.7, 3.3, -1.2, 0.4]))


def map_of(points: np.ndarray, pose: np.ndarray) -> SurfaceMap:
    surface = SurfaceMap(voxel_m=0.5, radius_m=100.0)
    surface.insert(points.astype(np.float32), now=1, pose=pose)
    return surface


@pytest.mark.parametrize("finest", [0, 1, 2])
def test_a_plane_is_found_where_it_was_seen(finest: int) -> None:
    probes = np.column_stack([RANDOM.uniform(-15, 15, (500, 2)), np.full(500, -1.79)])
    matches = map_of(FLOOR, TURNED).match(rigid.transform(TURNED, probes).T, finest)
    assert len(matches.rows) > 450
    along = TURNED[:3, 2] @ matches.normals
    np.testing.assert_allclose(np.abs(along), 1.0, atol=0.01)
    assert np.median(along * matches.distances) == pytest.approx(0.01, abs=0.003)


def test_a_world_far_off_is_as_good_as_any() -> None:
    away = np.array([5e5, 5.4e6, 2e2])
    probes = np.column_stack([RANDOM.uniform(-15, 15, (500, 2)), np.full(500, -1.79)])
    placed = rigid.transform(TURNED, probes)
    here = map_of(FLOOR, TURNED).match(placed.T)
    there = map_of(FLOOR, rigid.translation(away) @ TURNED).match((placed + away).T)
    np.testing.assert_array_equal(there.rows, here.rows)
    np.testing.assert_allclose(there.distances, here.distances, atol=1e-6)


def test_what_fine_voxels_do_not_know_coarser_ones_tell() -> None:
    one_a_fine_voxel = FLOOR[:6_000]
    matches = map_of(one_a_fine_voxel, np.eye(4)).match(one_a_fine_voxel.T)
    assert len(matches.rows) > 0.95 * len(one_a_fine_voxel)


def test_an_empty_map_knows_no_plane() -> None:
    assert len(SurfaceMap(voxel_m=0.5, radius_m=100.0).match(FLOOR.T).rows) == 0


def test_what_is_far_behind_is_forgotten() -> None:
    surface = map_of(FLOOR, np.eye(4))
    surface.insert(FLOOR, now=5, pose=rigid.translation((300.0, 0.0, 0.0)))
    assert len(surface.match(FLOOR.T).rows) == 0
    assert surface.means[0].min() > 200.0
