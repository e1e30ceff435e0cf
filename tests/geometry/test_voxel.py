"""Laws of voxels and of the planes through them."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry import planes, voxel

POINTS = np.random.default_rng(0).uniform(-40, 40, (3000, 3))


@pytest.mark.parametrize("size_m", [0.2, 1.0, 3.0])
def test_a_point_lies_in_its_voxel(size_m: float) -> None:
    centres = voxel.voxel_centres(voxel.voxel_keys(POINTS, size_m), size_m)
    assert np.abs(POINTS - centres).max() <= size_m / 2 + 1e-9


def test_cells_and_keys_undo_each_other() -> None:
    keys = voxel.voxel_keys(POINTS, 0.5)
    np.testing.assert_array_equal(voxel.cell_keys(voxel.voxel_cells(keys)), keys)


def test_thinning_keeps_one_point_a_voxel() -> None:
    kept = voxel.voxel_keys(POINTS[voxel.thin(POINTS, 4.0)], 4.0)
    assert len(np.unique(kept)) == len(kept)
    np.testing.assert_array_equal(np.unique(kept), np.unique(voxel.voxel_keys(POINTS, 4.0)))


def test_thinning_does_not_depend_on_order() -> None:
    order = np.random.default_rng(1).permutation(len(POINTS))
    kept = POINTS[voxel.thin(POINTS, 4.0)]
    np.testing.assert_array_equal(POINTS[order][voxel.thin(POINTS[order], 4.0)], kept)


def test_thinning_nothing_is_nothing() -> None:
    assert len(voxel.thin(np.zeros((0, 3)), 1.0)) == 0


def test_groups_are_the_equal_keys() -> None:
    keys = np.array([5, 3, 5, 3, 9])
    order, starts = voxel.group_by_key(keys)
    np.testing.assert_array_equal(keys[order], [3, 3, 5, 5, 9])
    np.testing.assert_array_equal(starts, [0, 2, 4])


@pytest.mark.parametrize("reach", [50, 10**7], ids=["near", "too far for one number"])
def test_groups_of_cells_are_those_of_their_keys(reach: int) -> None:
    cells = np.floor(np.random.default_rng(3).uniform(-3, 3, (3, 2000)))
    cells[:, 0] = reach, -reach, reach
    order, starts = voxel.group_by_cell(cells)
    keys = voxel.cell_keys(cells.T.astype(np.int64))
    _, sizes = np.unique(keys, return_counts=True)
    np.testing.assert_array_equal(np.sort(np.diff(starts, append=2000)), np.sort(sizes))
    assert all(len(set(part)) == 1 for part in np.split(keys[order], starts[1:]))


def test_moments_give_mean_and_covariance() -> None:
    mean, covariance = planes.mean_and_covariance(planes.summed_moments(POINTS.T, np.array([0])))
    np.testing.assert_allclose(mean[:, 0], POINTS.mean(axis=0))
    truth = np.cov(POINTS.T, bias=True)[np.triu_indices(3)]
    np.testing.assert_allclose(covariance[:, 0], truth, atol=1e-9)


def test_shifted_moments_are_those_of_shifted_points() -> None:
    shift = np.array([[1.0], [-2.0], [3.0]])
    moved = planes.shift_moments(planes.summed_moments(POINTS.T, np.array([0])), shift)
    again = planes.summed_moments(POINTS.T + shift, np.array([0]))
    np.testing.assert_allclose(moved, again, rtol=1e-9)


def test_normals_are_the_smallest_eigenvectors() -> None:
    random = np.random.default_rng(2)
    spread = random.normal(size=(200, 3, 3)) * np.array([1.0, 0.5, 0.05])
    matrices = spread @ np.swapaxes(spread, 1, 2)
    rows, columns = np.triu_indices(3)
    normals, variances = planes.plane_normals(matrices[:, rows, columns])
    values, vectors = np.linalg.eigh(matrices)
    np.testing.assert_allclose(variances, values, atol=1e-9)
    np.testing.assert_allclose(np.abs(np.einsum("vi,vi->v", normals, vectors[:, :, 0])), 1.0)
