"""Segmentation scores: hand-computed cases, laws, and what is left undefined."""

from __future__ import annotations

from math import isnan

import numpy as np
import pytest

from lidaraccum.errors import InputError
from lidaraccum.metrics.segmentation import SegmentationCounts, compare


def test_hand_computed_scores() -> None:
    predicted = np.array([True, True, True, False, False, False])
    truth = np.array([True, True, False, True, True, False])
    counts = compare(predicted, truth)
    assert counts == SegmentationCounts(2, 1, 2, 1)
    assert (counts.precision, counts.recall, counts.iou) == (2 / 3, 0.5, 0.4)


def test_a_perfect_answer_is_perfect_and_its_opposite_worthless() -> None:
    truth = np.random.default_rng(0).random(100) < 0.3
    right, wrong = compare(truth, truth), compare(~truth, truth)
    assert (right.precision, right.recall, right.iou) == (1, 1, 1)
    assert (wrong.precision, wrong.recall, wrong.iou) == (0, 0, 0)


def test_swapping_answer_and_truth_swaps_precision_and_recall() -> None:
    predicted, truth = np.random.default_rng(1).random((2, 200)) < 0.4
    there, back = compare(predicted, truth), compare(truth, predicted)
    assert (there.precision, there.recall, there.iou) == (back.recall, back.precision, back.iou)


def test_pooled_windows_count_all_points_in_any_order() -> None:
    predicted, truth = np.random.default_rng(2).random((2, 300)) < 0.5
    order = np.random.default_rng(3).permutation(300)
    windows = np.array_split(order, 7)
    pooled = SegmentationCounts.pool(compare(predicted[part], truth[part]) for part in windows)
    assert pooled == compare(predicted, truth)


def test_what_nothing_can_be_said_of_is_not_a_number() -> None:
    none, some = np.zeros(3, dtype=bool), np.array([True, False, False])
    assert isnan(compare(none, some).precision)
    assert compare(none, some).recall == 0
    assert isnan(compare(some, none).recall)
    assert compare(some, none).precision == 0
    assert isnan(compare(none, none).iou)
    assert isnan(SegmentationCounts.pool(()).iou)


def test_what_are_no_labels_is_refused() -> None:
    with pytest.raises(InputError, match="bool"):
        compare(np.array([1, 0]), np.array([True, False]))
    with pytest.raises(InputError, match="shape"):
        compare(np.array([True]), np.array([True, False]))
