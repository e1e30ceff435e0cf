"""Laws of what is kept and what is left out."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.data.accumulation import BACKGROUND, MOVING, AccumulatedFrame
from lidaraccum.errors import SettingsError
from lidaraccum.pipeline.selection import Selection, SelectionSettings, VoxelFilter


def placed(points: np.ndarray, label: np.ndarray | None = None) -> AccumulatedFrame:
    count = len(points)
    return AccumulatedFrame(
        index=0,
        points=np.asarray(points, dtype=np.float64),
        rows=np.arange(count),
        row_count=count,
        label=np.zeros(count, np.uint8) if label is None else label,
        instance=np.zeros(count, np.int32),
        confidence=np.zeros(count, np.float32),
        time=np.zeros(count),
        range_m=np.linalg.norm(points, axis=1),
        stamp=0.0,
        reference_from_sensor=np.eye(4),
        attributes={"intensity": np.arange(count)},
    )


def chosen(points: np.ndarray, settings: SelectionSettings, **more: np.ndarray) -> np.ndarray:
    return Selection(settings)(placed(points, **more)).rows


@pytest.fixture
def points() -> np.ndarray:
    return np.random.default_rng(0).uniform(-30, 30, size=(5000, 3))


def test_by_default_every_point_stays(points: np.ndarray) -> None:
    np.testing.assert_array_equal(chosen(points, SelectionSettings()), np.arange(len(points)))


def test_crop_keeps_exactly_the_box(points: np.ndarray) -> None:
    rows = chosen(points, SelectionSettings(crop_m=(-5, -6, -2, 7, 8, 3)))
    inside = np.all((points >= [-5, -6, -2]) & (points <= [7, 8, 3]), axis=1)
    np.testing.assert_array_equal(rows, np.flatnonzero(inside))


def test_ranges_keep_exactly_the_shell(points: np.ndarray) -> None:
    rows = chosen(points, SelectionSettings(min_range_m=10, max_range_m=20))
    ranges = np.linalg.norm(points, axis=1)
    np.testing.assert_array_equal(rows, np.flatnonzero((ranges >= 10) & (ranges <= 20)))


def test_movers_can_be_dropped(points: np.ndarray) -> None:
    label = np.where(np.arange(len(points)) % 3, BACKGROUND, MOVING).astype(np.uint8)
    rows = chosen(points, SelectionSettings(drop_dynamic=True), label=label)
    np.testing.assert_array_equal(rows, np.flatnonzero(label != MOVING))


def test_attributes_stay_with_their_points(points: np.ndarray) -> None:
    frame = placed(points)
    kept = Selection(SelectionSettings(max_range_m=15))(frame)
    np.testing.assert_array_equal(kept.attributes["intensity"], kept.rows)


def test_a_voxel_keeps_its_first_point_over_all_calls(points: np.ndarray) -> None:
    edge = 1.5
    keep = VoxelFilter(edge)
    groups = np.zeros(len(points), np.int32)
    parts = np.array_split(np.arange(len(points)), 4)
    rows = np.concatenate([part[keep.first(points[part], groups[part])] for part in parts])
    _, first = np.unique(np.floor(points / edge), axis=0, return_index=True)
    np.testing.assert_array_equal(rows, np.sort(first))


def test_voxels_of_different_objects_are_apart() -> None:
    points = np.zeros((3, 3))
    keep = VoxelFilter(1.0).first(points, np.array([0, 7, 7], np.int32))
    np.testing.assert_array_equal(keep, [True, True, False])


@pytest.mark.parametrize(
    "wrong",
    [
        {"crop_m": (1.0, 2.0)},
        {"crop_m": (5.0, 0.0, 1.0, 1.0)},
        {"voxel_m": -1.0},
        {"min_range_m": 5.0, "max_range_m": 2.0},
    ],
)
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(SettingsError):
        SelectionSettings(**wrong)  # type: ignore[arg-type]
