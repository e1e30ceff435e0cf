"""An augmented window is still true: points of one thing still fall on each other."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.training.augment import NO_AUGMENTATION, AugmentSettings, LabelledFrame, augment

CHANGES = {
    "yaw": replace(NO_AUGMENTATION, yaw_deg=180.0),
    "quarter turns": replace(NO_AUGMENTATION, quarter_turns=1.0),
    "flip": replace(NO_AUGMENTATION, flip=1.0),
    "reverse": replace(NO_AUGMENTATION, reverse=1.0),
    "tilt": replace(NO_AUGMENTATION, tilt_deg=3.0),
    "height": replace(NO_AUGMENTATION, height_m=1.0),
    "rays": replace(NO_AUGMENTATION, rays=0.5),
    "all": AugmentSettings(jitter_m=0.0),
}


def window_of(toy: ModuleType) -> list[LabelledFrame]:
    park = toy.CarPark(1)
    return [(park[index], park.labels(index)) for index in range(4)]


def in_own_box(frame: LabelledFrame) -> np.ndarray:
    """(N,) True for points of objects that lie in their own box."""
    points, labels = frame
    inside = []
    for box in labels.boxes:
        own = points.points[labels.instance == box.id]
        local = rigid.transform(rigid.invert(box.sensor_from_object), own)
        reach = np.array([box.size_lwh[0] / 2, box.size_lwh[1] / 2])
        inside.append((np.abs(local[:, :2]) < reach + 0.01).all(axis=1) & (local[:, 2] > -0.01))
    return np.concatenate(inside)


@pytest.mark.parametrize("change", CHANGES)
def test_objects_stay_in_their_boxes(toy: ModuleType, change: str) -> None:
    changed = augment(window_of(toy), CHANGES[change], np.random.default_rng(3))
    for frame in changed:
        assert in_own_box(frame).all()


@pytest.mark.parametrize("change", CHANGES)
def test_poses_stay_rigid_and_the_ground_stays_one_plane(toy: ModuleType, change: str) -> None:
    changed = augment(window_of(toy), CHANGES[change], np.random.default_rng(4))
    spread = []
    for frame, labels in changed:
        turn = labels.world_from_sensor[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(turn) == pytest.approx(1.0)
        world = rigid.transform(labels.world_from_sensor, frame.points)
        spread.append(np.sort(world[:, 2])[: len(world) // 4])
    assert np.ptp(np.concatenate(spread)) < 0.01


def test_quarter_turns_leave_what_lies_along_the_grid_along_it(toy: ModuleType) -> None:
    first = window_of(toy)[0][0].points[:, :2]
    turns = set()
    for seed in range(20):
        changed = augment(window_of(toy), CHANGES["quarter turns"], np.random.default_rng(seed))
        turn = np.linalg.lstsq(first, changed[0][0].points[:, :2], rcond=None)[0].T
        np.testing.assert_allclose(np.sort(np.abs(turn).ravel()), [0, 0, 1, 1], atol=1e-5)
        turns.add(round(float(np.rad2deg(np.arctan2(turn[1, 0], turn[0, 0])))) % 360)
    assert turns == {90, 180, 270}


def test_stamps_go_up_backwards_too(toy: ModuleType) -> None:
    changed = augment(window_of(toy), CHANGES["reverse"], np.random.default_rng(0))
    stamps = [frame.stamp for frame, _ in changed]
    np.testing.assert_allclose(np.diff(stamps), 0.1)
    assert changed[0][0].name == "3"


def test_nothing_changes_when_nothing_is_asked(toy: ModuleType) -> None:
    before = window_of(toy)
    after = augment(before, NO_AUGMENTATION, np.random.default_rng(0))
    for (frame, labels), (same, same_labels) in zip(before, after, strict=True):
        np.testing.assert_allclose(same.points, frame.points, atol=1e-6)
        np.testing.assert_allclose(same_labels.world_from_sensor, labels.world_from_sensor)


def test_dense_frames_are_thinned_to_the_bound(toy: ModuleType) -> None:
    settings = replace(NO_AUGMENTATION, most_points=500)
    for frame, _ in augment(window_of(toy), settings, np.random.default_rng(0)):
        assert 400 < len(frame) < 600
