"""Where points truly belong, checked on a drive in which everything is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lidaraccum.data.window import Window
from lidaraccum.evaluation.truth import window_truth
from lidaraccum.geometry import rigid


def test_what_stands_goes_with_the_poses_and_the_car_with_its_boxes(hand_made: Any) -> None:
    truth = window_truth(Window(hand_made, 0, 3), 0)
    target = hand_made[0].points
    for frame in truth.frames[1:]:
        np.testing.assert_allclose(frame.in_target[:5], target, atol=1e-5)
        assert frame.known[:5].all()
    np.testing.assert_allclose(truth.poses[2], rigid.translation((2.0, 0.0, 0.0)))


def test_a_mover_that_the_target_does_not_show_belongs_nowhere_known(hand_made: Any) -> None:
    first = window_truth(Window(hand_made, 0, 3, "first"), 0)
    assert first.frames[1].known.tolist() == [True] * 5 + [False]
    last = window_truth(Window(hand_made, 0, 3, "last"), 0)
    assert last.frames[1].known.all()


def test_only_annotated_points_in_the_square_are_scored(hand_made: Any) -> None:
    square = window_truth(Window(hand_made, 0, 3), 32.0)
    assert square.frames[1].scored.tolist() == [True, True, False, True, True, True]
    everywhere = window_truth(Window(hand_made, 1, 2), 0)
    assert everywhere.frames[0].scored.all()
    annotated = np.array([True, False, True, True, False, True])
    hand_made.changes = {1: {"annotated": annotated}}
    told = window_truth(Window(hand_made, 1, 2), 0)
    assert told.frames[0].scored.tolist() == annotated.tolist()


def test_points_at_the_stamp_are_the_truth_where_they_are_given(hand_made: Any) -> None:
    plain = window_truth(Window(hand_made, 1, 2), 0)
    shift = np.array([0.3, 0.0, 0.0])
    hand_made.changes = {2: {"points_at_stamp": hand_made[2].points + shift}}
    moved = window_truth(Window(hand_made, 1, 2), 0)
    np.testing.assert_allclose(
        moved.frames[1].in_target - plain.frames[1].in_target, np.tile(shift, (6, 1)), atol=1e-6
    )


def test_a_mover_follows_its_boxes_in_frames_where_it_stands(hand_made: Any) -> None:
    moving = window_truth(Window(hand_made, 0, 3), 0)
    hand_made.changes = {2: {"dynamic": np.zeros(6, dtype=bool)}}
    truth = window_truth(Window(hand_made, 0, 3), 0)
    np.testing.assert_allclose(truth.frames[2].in_target, moving.frames[2].in_target)
    assert not truth.frames[2].dynamic.any()


@pytest.mark.parametrize("target", ["first", "middle", "last"])
def test_the_target_frame_itself_does_not_move(hand_made: Any, target: str) -> None:
    window = Window(hand_made, 0, 3, target)
    truth = window_truth(window, 0).frames[window.target]
    np.testing.assert_allclose(truth.in_target, truth.at_stamp, atol=1e-9)
