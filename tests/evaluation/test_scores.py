"""Scores of one window, and of several together."""

from __future__ import annotations

from typing import Any

import pytest

from lidaraccum.data.window import Window
from lidaraccum.evaluation.categories import CAR
from lidaraccum.evaluation.scores import Scores, score_window
from lidaraccum.evaluation.truth import Scope, window_truth

EVERYWHERE = Scope(half_width_m=0)


def test_the_truth_itself_scores_perfectly(placed: Any, hand_made: Any) -> None:
    truth = window_truth(Window(hand_made, 0, 3), EVERYWHERE)
    scores = score_window(placed(truth), truth, 0, 1.5)
    assert scores.flow.everything.epe_mean == 0.0
    assert (scores.flow.static.points, scores.flow.dynamic.points) == (6, 4)
    assert scores.unknown_points == 2
    assert scores.motion.iou == scores.foreground.iou == 1.0
    assert scores.association.weighted_coverage == 1.0
    assert scores.moving_association.weighted_coverage == 1.0
    assert scores.absolute.translation.largest == scores.relative.translation.largest == 0.0
    assert scores.seconds_per_window == 1.5


def test_a_shift_is_the_epe_of_every_source_frame_and_of_none_but_those(
    placed: Any, hand_made: Any
) -> None:
    truth = window_truth(Window(hand_made, 0, 3), EVERYWHERE)
    scores = score_window(placed(truth, 0.2), truth, 0, 0.0)
    assert scores.flow.everything.epe_mean == pytest.approx(0.2)
    assert sorted(scores.by_gap) == [1, 2]
    assert scores.by_speed.dynamic_error[CAR] == pytest.approx((0.4 / 6.0), rel=1e-3)
    assert scores.by_speed.points.sum() == 10
    assert sum(flow.everything.points for flow in scores.by_gap.values()) == 10


def test_gaps_count_both_ways_from_a_target_in_the_middle(placed: Any, hand_made: Any) -> None:
    window = Window(hand_made, 0, 3, "middle")
    truth = window_truth(window, EVERYWHERE)
    scores = score_window(placed(truth), truth, window.target, 0.0)
    assert list(scores.by_gap) == [1]


def test_two_added_are_both(placed: Any, hand_made: Any) -> None:
    truth = window_truth(Window(hand_made, 0, 3), EVERYWHERE)
    one = score_window(placed(truth, 0.1), truth, 0, 1.0)
    other = score_window(placed(truth, 0.3), truth, 0, 3.0)
    both = one + other
    assert both.flow.everything.epe_mean == pytest.approx(0.2)
    assert both.by_gap[2].everything.points == 2 * one.by_gap[2].everything.points
    assert both.seconds_per_window == 2.0
    assert Scores.pool([]).windows == 0
    assert Scores.pool([one, other]).flow.static.points == both.flow.static.points
