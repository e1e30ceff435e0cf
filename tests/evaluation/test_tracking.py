"""The Kalman tracker keeps what moves steadily apart and together."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.evaluation.tracking import KalmanTracker

STAMPS = [0.1 * index for index in range(6)]


def body(x: float, y: float) -> np.ndarray:
    rng = np.random.default_rng(2)
    return rng.uniform(0, 1, (400, 3)) * [3.0, 1.5, 1.2] + [x, y, 0.0]


def test_two_cars_that_pass_each_other_keep_their_ids() -> None:
    frames = [
        np.concatenate([body(1.2 * index, 0.0), body(8.0 - 1.2 * index, 4.0)]) for index in range(6)
    ]
    ids = KalmanTracker().follow(frames, STAMPS)
    for found in ids:
        assert set(found[:400].tolist()) == set(ids[0][:400].tolist())
        assert set(found[400:].tolist()) == set(ids[0][400:].tolist())
    assert set(ids[0][:400].tolist()) != set(ids[0][400:].tolist())


def test_a_steady_velocity_is_learnt() -> None:
    tracker = KalmanTracker()
    tracker.follow([body(1.0 * index, 0.0) for index in range(6)], STAMPS)
    assert tracker.tracks[0].state[1] == pytest.approx([10.0, 0.0, 0.0], abs=0.3)


def test_a_jump_beyond_the_gate_is_another_object() -> None:
    tracker = KalmanTracker()
    ids = tracker.follow([body(0.0, 0.0), body(0.0, 30.0)], STAMPS[:2])
    assert set(ids[0].tolist()) != set(ids[1].tolist())
    assert len(tracker.tracks) == 2


def test_a_frame_without_points_is_no_trouble() -> None:
    ids = KalmanTracker().follow([body(0, 0), np.zeros((0, 3)), body(0.2, 0)], STAMPS[:3])
    assert set(ids[0].tolist()) == set(ids[2].tolist())
