"""Where points truly belong, checked on a drive in which everything is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.window import Window
from lidaraccum.errors import SettingsError
from lidaraccum.evaluation.truth import Scope, window_truth
from lidaraccum.geometry import rigid
from lidaraccum.io.sequences import open_sequence

EVERYWHERE = Scope(half_width_m=0)


def test_what_stands_goes_with_the_poses_and_the_car_with_its_boxes(hand_made: Any) -> None:
    truth = window_truth(Window(hand_made, 0, 3), EVERYWHERE)
    target = hand_made[0].points
    for frame in truth.frames[1:]:
        np.testing.assert_allclose(frame.in_target[:5], target, atol=1e-5)
        assert frame.known[:5].all()
    np.testing.assert_allclose(truth.poses[2], rigid.translation((2.0, 0.0, 0.0)))


def test_a_mover_that_the_target_does_not_show_belongs_nowhere_known(hand_made: Any) -> None:
    first = window_truth(Window(hand_made, 0, 3, "first"), EVERYWHERE)
    assert first.frames[1].known.tolist() == [True] * 5 + [False]
    last = window_truth(Window(hand_made, 0, 3, "last"), EVERYWHERE)
    assert last.frames[1].known.all()


def test_only_annotated_points_in_the_square_are_scored(hand_made: Any) -> None:
    square = window_truth(Window(hand_made, 0, 3), Scope(32.0))
    assert square.frames[1].scored.tolist() == [True, True, False, True, True, True]
    everywhere = window_truth(Window(hand_made, 1, 2), EVERYWHERE)
    assert everywhere.frames[0].scored.all()
    annotated = np.array([True, False, True, True, False, True])
    hand_made.changes = {1: {"annotated": annotated}}
    told = window_truth(Window(hand_made, 1, 2), EVERYWHERE)
    assert told.frames[0].scored.tolist() == annotated.tolist()


def test_points_at_the_stamp_are_the_truth_where_they_are_given(hand_made: Any) -> None:
    plain = window_truth(Window(hand_made, 1, 2), EVERYWHERE)
    shift = np.array([0.3, 0.0, 0.0])
    hand_made.changes = {2: {"points_at_stamp": hand_made[2].points + shift}}
    moved = window_truth(Window(hand_made, 1, 2), EVERYWHERE)
    np.testing.assert_allclose(
        moved.frames[1].in_target - plain.frames[1].in_target, np.tile(shift, (6, 1)), atol=1e-6
    )


def test_a_mover_follows_its_boxes_in_frames_where_it_stands(hand_made: Any) -> None:
    moving = window_truth(Window(hand_made, 0, 3), EVERYWHERE)
    hand_made.changes = {2: {"dynamic": np.zeros(6, dtype=bool)}}
    truth = window_truth(Window(hand_made, 0, 3), EVERYWHERE)
    np.testing.assert_allclose(truth.frames[2].in_target, moving.frames[2].in_target)
    assert not truth.frames[2].dynamic.any()


@pytest.mark.parametrize("target", ["first", "middle", "last"])
def test_the_target_frame_itself_does_not_move(hand_made: Any, target: str) -> None:
    window = Window(hand_made, 0, 3, target)
    truth = window_truth(window, EVERYWHERE).frames[window.target]
    np.testing.assert_allclose(truth.in_target, truth.at_stamp, atol=1e-9)


def test_the_ground_can_be_left_out(street: Path) -> None:
    window = Window(open_sequence(street), 0, 2)
    whole = window_truth(window, EVERYWHERE).frames[1]
    above = window_truth(window, Scope(0, above_ground_m=0.5)).frames[1]
    assert not (above.scored & ~whole.scored).any()
    low, high = window[1].points[~above.scored], window[1].points[above.scored]
    assert np.median(low[:, 2]) < np.median(high[:, 2])
    assert 0.1 < above.scored.mean() < 0.8
    movable = whole.foreground
    assert above.scored[movable].mean() > 1.5 * above.scored[~movable].mean()


def test_a_negative_scope_is_refused() -> None:
    for sizes in ((-1.0, 0.0), (32.0, -0.1)):
        with pytest.raises(SettingsError):
            Scope(*sizes)
