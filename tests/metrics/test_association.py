"""Instance scores: against brute force, hand-computed cases, and laws."""

from __future__ import annotations

from math import isnan

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.metrics.association import (
    IOU_THRESHOLDS,
    AssociationScore,
    keep_majority,
    score,
)


def masks(instance: NDArray[np.int64]) -> list[NDArray[np.bool_]]:
    return [instance == i for i in sorted(set(instance.tolist()) - {0})]


def iou(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    return (one & other).sum() / (one | other).sum()


def random_pair(seed: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Truth of some instances, and a prediction that merges, splits, loses and invents some."""
    random = np.random.default_rng(seed)
    truth = random.integers(0, 9, size=300)
    truth[random.random(300) < 0.3] = 0
    predicted = np.array([0, 7, 7, 3, 40, 5, 0, 11, 12])[truth]
    noisy = random.random(300) < random.choice([0.02, 0.2])
    predicted[noisy] = random.integers(0, 50, size=int(noisy.sum()))
    return predicted, truth


@pytest.mark.parametrize("seed", range(8))
def test_scores_are_those_of_brute_force(seed: int) -> None:
    predicted, truth = random_pair(seed)
    true_masks, predicted_masks = masks(truth), masks(predicted)
    best = [max(iou(t, p) for p in predicted_masks) for t in true_masks]
    best_of_predicted = [max(iou(t, p) for t in true_masks) for p in predicted_masks]
    sizes = [int(t.sum()) for t in true_masks]
    found = score(predicted, truth)
    assert found.weighted_coverage == pytest.approx(np.average(best, weights=sizes))
    for k, threshold in enumerate(IOU_THRESHOLDS):
        assert found.recall[k] == np.mean(np.array(best) > threshold)
        assert found.precision[k] == np.mean(np.array(best_of_predicted) > threshold)


def test_hand_computed_coverage() -> None:
    truth = np.array([1, 1, 1, 1, 2, 2, 0, 0])
    predicted = np.array([5, 5, 5, 0, 6, 6, 6, 0])
    found = score(predicted, truth)
    assert found.weighted_coverage == pytest.approx((4 * 3 / 4 + 2 * 2 / 3) / 6)
    np.testing.assert_array_equal(found.recall, [1.0, 1.0, 0.5, 0.0, 0.0])
    np.testing.assert_array_equal(found.precision, [1.0, 1.0, 0.5, 0.0, 0.0])


def test_two_halves_of_an_object_find_it_not() -> None:
    # Both have an IoU of exactly one half: were that enough, one object would be found twice.
    found = score(np.array([1, 1, 2, 2]), np.array([7, 7, 7, 7]))
    assert found.recall[0] == 0
    assert found.weighted_coverage == 0.5


def test_a_perfect_answer_is_perfect_whatever_the_names() -> None:
    _, truth = random_pair(0)
    renamed = np.array([0, 90, 17, 3, 4, 61, 5, 8, 1])[truth]
    found = score(renamed, truth)
    assert found.weighted_coverage == 1.0
    np.testing.assert_array_equal(found.precision, 1.0)
    np.testing.assert_array_equal(found.recall, 1.0)


def test_the_order_of_points_does_not_matter() -> None:
    predicted, truth = random_pair(1)
    order = np.random.default_rng(0).permutation(len(truth))
    mixed, straight = score(predicted[order], truth[order]), score(predicted, truth)
    assert mixed.weighted_coverage == pytest.approx(straight.weighted_coverage)
    np.testing.assert_array_equal(mixed.found, straight.found)


def test_pooled_windows_keep_their_instances_apart() -> None:
    # The same id in two windows is two instances; WCov weighs by points, mWCov by windows.
    good = score(np.ones(9, np.int64), np.ones(9, np.int64))
    missed = score(np.zeros(1, np.int64), np.ones(1, np.int64))
    still = score(np.zeros(5, np.int64), np.zeros(5, np.int64))
    pooled = AssociationScore.pool([good, missed, still])
    assert (pooled.windows, pooled.true_instances, pooled.covered_windows) == (3, 2, 2)
    assert pooled.weighted_coverage == 0.9
    assert pooled.mean_weighted_coverage == 0.5
    np.testing.assert_array_equal(pooled.recall, 0.5)
    np.testing.assert_array_equal(pooled.precision, 1.0)


def test_what_nothing_can_be_said_of_is_not_a_number() -> None:
    none, one = np.zeros(3, np.int64), np.ones(3, np.int64)
    assert isnan(score(one, none).weighted_coverage)
    assert np.isnan(score(one, none).recall).all()
    np.testing.assert_array_equal(score(one, none).precision, 0.0)
    assert score(none, one).weighted_coverage == 0
    assert np.isnan(score(none, one).precision).all()
    for nothing in (score(none[:0], none[:0]), AssociationScore.pool(())):
        assert isnan(nothing.weighted_coverage)
        assert isnan(nothing.mean_weighted_coverage)


def test_only_instances_with_most_points_inside_are_kept() -> None:
    instance = np.array([1, 1, 1, 2, 2, 3, 0, 0])
    moving = np.array([True, True, False, True, False, False, True, True])
    np.testing.assert_array_equal(keep_majority(instance, moving), [1, 1, 1, 0, 0, 0, 0, 0])
    assert keep_majority(instance[:0], moving[:0]).shape == (0,)


def test_what_are_no_instances_is_refused() -> None:
    ids = np.ones(3, np.int64)
    with pytest.raises(InputError, match="0 for none"):
        score(np.array([0, -1, 2]), ids)
    with pytest.raises(InputError, match="integers"):
        score(ids.astype(np.float64), ids)
    with pytest.raises(InputError, match="3 predicted and 2 true"):
        score(ids, ids[:2])
    with pytest.raises(InputError, match="member"):
        keep_majority(ids, np.ones(2, dtype=bool))
