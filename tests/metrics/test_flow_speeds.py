"""Bucket-normalised flow errors: hand-computed cases and the score's own laws."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.errors import InputError
from lidaraccum.metrics.flow import FlowErrors
from lidaraccum.metrics.flow_speeds import SPEED_EDGES_MPS, FlowBySpeed, summarise_by_speed

NAMES = ("background", "car", "pedestrian")


def example() -> FlowBySpeed:
    # Two standing points; a car at 10.1 m/s and one far beyond 20; a pedestrian at 1.3 m/s.
    way = np.array([0.0, 0.01, 1.01, 1.01, 5.0, 0.13])
    epe = np.array([0.02, 0.04, 0.101, 0.303, 5.0, 0.13])
    category = np.array([0, 1, 1, 1, 1, 2])
    return summarise_by_speed(FlowErrors(epe, np.ones(6)), way, 0.1, category, NAMES)


def test_the_buckets_are_those_of_the_challenge() -> None:
    assert len(SPEED_EDGES_MPS) == 52
    np.testing.assert_allclose(SPEED_EDGES_MPS[[0, 1, 50]], [0.0, 0.4, 20.0])
    assert SPEED_EDGES_MPS[51] == np.inf


def test_hand_computed_buckets() -> None:
    found = example()
    np.testing.assert_allclose(found.static_epe, [0.02, 0.04, np.nan])
    # The car's two buckets, 0.2 and 1.0, count the same; the pedestrian stood in the answer.
    np.testing.assert_allclose(found.dynamic_error, [np.nan, 0.6, 1.0])
    assert found.normalised_epe[1, 24] == pytest.approx(0.2)
    assert found.normalised_epe[1, 49] == pytest.approx(1.0)
    assert found.mean_static_epe == pytest.approx(0.03)
    assert found.mean_dynamic_error == pytest.approx(0.8)
    assert found.points.sum() == 6


def test_saying_that_all_stands_scores_one_at_every_speed_and_gap() -> None:
    way = np.random.default_rng(0).uniform(1.0, 30.0, size=500)
    gap = np.random.default_rng(1).choice([0.1, 0.2, 0.4], size=500)
    category = np.random.default_rng(2).integers(1, 3, size=500)
    found = summarise_by_speed(FlowErrors(way, np.ones(500)), way, gap, category, NAMES)
    np.testing.assert_allclose(found.dynamic_error[1:], 1.0)


def test_frames_before_the_target_have_a_speed_too() -> None:
    errors = FlowErrors(np.array([0.1]), np.ones(1))
    later, before = (
        summarise_by_speed(errors, np.ones(1), gap, np.array([1]), NAMES) for gap in (0.2, -0.2)
    )
    np.testing.assert_array_equal(later.points, before.points)


def test_pooled_windows_are_summed() -> None:
    pooled = FlowBySpeed.pool([example(), example()], NAMES)
    np.testing.assert_array_equal(pooled.points, 2 * example().points)
    assert pooled.mean_dynamic_error == pytest.approx(0.8)


def test_no_points_score_nothing() -> None:
    empty = summarise_by_speed(
        FlowErrors(np.zeros(0), np.zeros(0)), np.zeros(0), 0.1, np.zeros(0, np.int64), NAMES
    )
    for nothing in (empty, FlowBySpeed.pool((), NAMES)):
        assert nothing.points.shape == (3, 51)
        assert np.isnan([nothing.mean_static_epe, nothing.mean_dynamic_error]).all()


def test_what_cannot_be_sorted_is_refused() -> None:
    one = FlowErrors(np.zeros(1), np.ones(1))
    index = np.zeros(1, np.int64)
    with pytest.raises(InputError, match="no speed"):
        summarise_by_speed(one, np.zeros(1), 0.0, index, NAMES)
    with pytest.raises(InputError, match="category"):
        summarise_by_speed(one, np.zeros(1), 0.1, index + 3, NAMES)
    with pytest.raises(InputError, match="2 ways"):
        summarise_by_speed(one, np.zeros(2), 0.1, index, NAMES)
    with pytest.raises(InputError, match="differ"):
        FlowBySpeed.pool([example()], ("car",))
