"""Pose errors: those of the ``evo`` package, and the laws that need no package."""

from __future__ import annotations

import numpy as np
import pytest
from evo.core import metrics as evo
from evo.core.trajectory import PosePath3D
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.metrics.trajectory import (
    ErrorStatistics,
    PoseErrors,
    absolute_errors,
    aligned,
    from_first,
    pairs_by_distance,
    pairs_by_frames,
    path_lengths,
    relative_errors,
)

Poses = NDArray[np.float64]


def drive(steps: int = 60, seed: int = 0) -> Poses:
    """A winding drive of about 1 m a step, with some roll and pitch."""
    random = np.random.default_rng(seed)
    twists = np.column_stack(
        [
            random.normal(0.0, 0.01, steps),
            random.normal(0.0, 0.01, steps),
            0.05 * np.sin(np.arange(steps) / 9) + random.normal(0.0, 0.01, steps),
            random.uniform(0.5, 1.5, steps),
            np.zeros((steps, 2)),
        ]
    )
    poses = [rigid.exponential(np.array([0.3, -0.1, 2.0, 50.0, -20.0, 3.0]))]
    for twist in twists:
        poses.append(poses[-1] @ rigid.exponential(twist))
    return np.stack(poses)


def drifting(true: Poses, seed: int = 1) -> Poses:
    """The drive as an odometry with errors in each step would tell it."""
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (len(true), 6))
    noise *= [0.004, 0.004, 0.004, 0.03, 0.03, 0.03]
    steps = rigid.invert(true[:-1]) @ true[1:]
    poses = [true[0]]
    for step, error in zip(steps, noise[1:], strict=True):
        poses.append(poses[-1] @ step @ rigid.exponential(error))
    return np.stack(poses)


def straight(steps: int = 20) -> Poses:
    poses = np.tile(np.eye(4), (steps, 1, 1))
    poses[:, 0, 3] = np.arange(steps)
    return poses


def path(poses: Poses) -> PosePath3D:
    return PosePath3D(poses_se3=list(poses))


def evo_errors(metric: evo.PE, true: Poses, estimated: Poses) -> NDArray[np.float64]:
    metric.process_data((path(true), path(estimated)))
    return metric.error


def evo_absolute(relation: evo.PoseRelation, true: Poses, estimated: Poses) -> NDArray[np.float64]:
    return evo_errors(evo.APE(relation), true, estimated)


TRANSLATION, ROTATION = evo.PoseRelation.translation_part, evo.PoseRelation.rotation_angle_rad


def test_absolute_errors_are_those_of_evo() -> None:
    true = drive()
    estimated = drifting(true)
    found = absolute_errors(estimated, true)
    expected = evo_absolute(TRANSLATION, true, estimated)
    np.testing.assert_allclose(found.translation_m, expected, atol=1e-9)
    np.testing.assert_allclose(
        found.rotation_rad, evo_absolute(ROTATION, true, estimated), atol=1e-7
    )


def test_aligned_errors_are_those_of_evo() -> None:
    true = drive()
    estimated = from_first(drifting(true))
    expected = path(estimated)
    expected.align(path(true))
    found = aligned(estimated, true)
    np.testing.assert_allclose(found, np.stack(expected.poses_se3), atol=1e-6)
    assert absolute_errors(found, true).translation.rmse < 1.0


@pytest.mark.parametrize("delta", [1, 5, 30])
def test_relative_errors_over_frames_are_those_of_evo(delta: int) -> None:
    true = drive()
    estimated = drifting(true)
    found = relative_errors(estimated, true, pairs_by_frames(len(true), delta))
    for relation, errors in ((TRANSLATION, found.translation_m), (ROTATION, found.rotation_rad)):
        metric = evo.RPE(relation, delta=delta, delta_unit=evo.Unit.frames, all_pairs=True)
        np.testing.assert_allclose(errors, evo_errors(metric, true, estimated), atol=1e-7)


@pytest.mark.parametrize("distance", [5.0, 20.0])
def test_relative_errors_over_a_distance_are_those_of_evo(distance: float) -> None:
    true = drive()
    estimated = drifting(true)
    found = relative_errors(estimated, true, pairs_by_distance(true, distance))
    metric = evo.RPE(
        TRANSLATION,
        delta=distance,
        delta_unit=evo.Unit.meters,
        all_pairs=True,
        pairs_from_reference=True,
    )
    expected = evo_errors(metric, true, estimated)
    np.testing.assert_allclose(found.translation_m, expected, atol=1e-9)


def test_statistics_are_those_of_evo() -> None:
    true = drive()
    metric = evo.APE(TRANSLATION)
    metric.process_data((path(true), path(drifting(true))))
    found = absolute_errors(drifting(true), true).translation
    kinds = (
        evo.StatisticsType.rmse,
        evo.StatisticsType.mean,
        evo.StatisticsType.median,
        evo.StatisticsType.max,
    )
    expected = [metric.get_statistic(kind) for kind in kinds]
    np.testing.assert_allclose([found.rmse, found.mean, found.median, found.largest], expected)


def test_path_lengths_are_those_of_evo() -> None:
    np.testing.assert_allclose(path_lengths(drive()), path(drive()).distances)


def test_the_truth_has_no_error() -> None:
    true = drive()
    for errors in (
        absolute_errors(true, true),
        absolute_errors(aligned(true, true), true),
        relative_errors(true, true, pairs_by_frames(len(true), 3)),
    ):
        np.testing.assert_allclose(errors.translation_m, 0.0, atol=1e-9)
        np.testing.assert_allclose(errors.rotation_rad, 0.0, atol=1e-7)


def test_moving_the_estimate_as_a_whole_changes_neither_relative_nor_aligned_errors() -> None:
    true = drive()
    estimated = drifting(true)
    moved = rigid.exponential(np.array([0.4, 1.0, -2.0, 100.0, 7.0, 2.0])) @ estimated
    pairs = pairs_by_frames(len(true), 4)
    np.testing.assert_allclose(
        relative_errors(moved, true, pairs).translation_m,
        relative_errors(estimated, true, pairs).translation_m,
        atol=1e-9,
    )
    np.testing.assert_allclose(aligned(moved, true), aligned(estimated, true), atol=1e-7)
    np.testing.assert_allclose(from_first(moved), from_first(estimated), atol=1e-9)


def test_alignment_is_the_best_there_is() -> None:
    true = drive()
    best = aligned(drifting(true), true)
    least = absolute_errors(best, true).translation.rmse
    for seed in range(20):
        twist = np.random.default_rng(seed).normal(0.0, 0.01, 6)
        centre = rigid.translation(best[:, :3, 3].mean(axis=0))
        nudged = centre @ rigid.exponential(twist) @ rigid.invert(centre) @ best
        assert absolute_errors(nudged, true).translation.rmse > least


@pytest.mark.parametrize("count", [1, 2, 20])
def test_a_straight_drive_is_aligned_by_its_orientations(count: int) -> None:
    true = straight(count)
    turned = rigid.exponential(np.array([2.0, 0.3, -1.0, 5.0, 6.0, 7.0])) @ true
    np.testing.assert_allclose(aligned(turned, true), true, atol=1e-6)


def test_a_standing_sensor_is_aligned_by_its_orientations() -> None:
    true = np.tile(rigid.exponential(np.array([0.1, 0.2, 0.3, 4.0, 5.0, 6.0])), (5, 1, 1))
    turned = rigid.exponential(np.array([2.0, 0.3, -1.0, 5.0, 6.0, 7.0])) @ true
    np.testing.assert_allclose(aligned(turned, true), true, atol=1e-6)


def test_a_mirrored_path_is_not_mirrored_back() -> None:
    true = drive()
    mirrored = true.copy()
    mirrored[:, 1, 3] *= -1.0
    found = aligned(mirrored, true)
    np.testing.assert_allclose(np.linalg.det(found[:, :3, :3]), 1.0)


def test_hand_computed_pairs() -> None:
    np.testing.assert_array_equal(pairs_by_frames(4, 2), [[0, 2], [1, 3]])
    np.testing.assert_array_equal(pairs_by_distance(straight(5), 3.1), [[0, 3], [1, 4]])
    assert pairs_by_frames(2, 5).shape == (0, 2)
    assert pairs_by_distance(straight(5), 50.0).shape == (0, 2)
    assert pairs_by_distance(straight(1), 1.0).shape == (0, 2)


def test_hand_computed_errors() -> None:
    true = straight(3)
    estimated = true.copy()
    estimated[2] = estimated[2] @ rigid.exponential(np.array([0.0, 0.0, 0.5, 0.0, 0.0, 0.0]))
    estimated[1, 1, 3] = 2.0
    found = absolute_errors(estimated, true)
    np.testing.assert_allclose(found.translation_m, [0.0, 2.0, 0.0])
    np.testing.assert_allclose(found.rotation_rad, [0.0, 0.0, 0.5])
    assert found.translation.mean == pytest.approx(2 / 3)
    assert found.rotation.largest == pytest.approx(0.5)


def test_no_pairs_have_no_errors() -> None:
    nothing = relative_errors(straight(3), straight(3), pairs_by_frames(3, 9))
    assert len(nothing) == 0
    for statistics in (nothing.translation, PoseErrors.pool(()).rotation):
        values = [statistics.rmse, statistics.mean, statistics.median, statistics.largest]
        assert np.isnan(values).all()


def test_pooled_windows_are_all_their_errors() -> None:
    one, two = (absolute_errors(drifting(drive(), s), drive()) for s in (1, 2))
    pooled = PoseErrors.pool([one, two])
    assert len(pooled) == len(one) + len(two)
    together = np.concatenate([one.translation_m, two.translation_m])
    assert pooled.translation == ErrorStatistics.of(together)


def test_what_is_no_trajectory_is_refused() -> None:
    true = straight(4)
    for wrong in (true[:3], true[0], true[:, :3], np.full_like(true, np.nan)):
        with pytest.raises(InputError, match="poses"):
            absolute_errors(wrong, true)
    with pytest.raises(InputError, match="poses"):
        aligned(true[:0], true[:0])
    with pytest.raises(InputError, match="no pair"):
        pairs_by_frames(4, 0)
    with pytest.raises(InputError, match="no pairs"):
        pairs_by_distance(true, 0.0)
