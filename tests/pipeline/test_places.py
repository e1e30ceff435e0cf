"""What frames say of a place adds up: many and near views outvote few and far ones."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry.voxel import voxel_cells
from lidaraccum.pipeline.places import CELL_M, REMEMBERED_FRAMES, Places, cell_keys

HERE = np.array([[0.1, 0.1]])


def heard(*frames: tuple[float, float, int]) -> float:
    """What is thought of a place of which frames told: probability, distance, points."""
    places = Places()
    for probability, distance_m, count in frames:
        told = np.full(count, probability, dtype=np.float32)
        places.note(np.repeat(HERE, count, axis=0), told, np.full(count, distance_m))
    return float(places.probability(HERE)[0])


def test_one_frame_is_believed() -> None:
    assert heard((0.8, 20.0, 5)) == pytest.approx(0.8)


def test_frames_are_averaged_whatever_their_order() -> None:
    told = ((0.9, 10.0, 10), (0.3, 10.0, 10), (0.3, 10.0, 10))
    assert heard(*told) == pytest.approx(0.5) == heard(*told[::-1])


def test_near_and_many_points_count_for_more() -> None:
    assert heard((0.9, 10.0, 10), (0.1, 30.0, 10)) == pytest.approx(0.7)
    assert heard((0.9, 10.0, 30), (0.1, 10.0, 10)) == pytest.approx(0.7)
    # Not without bound: one frame close by is still one frame.
    assert heard((0.9, 1.0, 5000), *[(0.1, 5.0, 50)] * 3) == pytest.approx(0.3)


def test_places_are_apart() -> None:
    rng = np.random.default_rng(0)
    spots = rng.integers(-2000, 2000, (500, 2)) * (3 * CELL_M)
    spots = np.unique(spots, axis=0) + 0.2 * CELL_M
    told = rng.uniform(0, 1, len(spots)).astype(np.float32)
    places = Places()
    half = len(spots) // 2
    for part in (slice(0, half), slice(half, None)):
        places.note(spots[part], told[part], np.full(len(spots[part]), 10.0))
    np.testing.assert_allclose(places.probability(spots), told, rtol=1e-6)


def test_what_nobody_saw_for_long_is_forgotten() -> None:
    places = Places()
    places.note(HERE, np.array([0.9], dtype=np.float32), np.array([10.0]))
    elsewhere = HERE + 100 * CELL_M
    for _ in range(REMEMBERED_FRAMES):
        places.note(elsewhere, np.array([0.5], dtype=np.float32), np.array([10.0]))
    places.note(HERE, np.array([0.1], dtype=np.float32), np.array([10.0]))
    assert places.probability(HERE)[0] == pytest.approx(0.1)


def test_cells_are_found_again_by_their_number() -> None:
    places = np.random.default_rng(0).uniform(-5000, 5000, (1000, 2))
    x, y, _ = voxel_cells(cell_keys(places)).T
    np.testing.assert_array_equal(np.column_stack([x, y]), np.floor(places / CELL_M))
