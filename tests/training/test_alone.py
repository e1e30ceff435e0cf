"""What speaks for an object's motion, and what only lies about."""

from __future__ import annotations

import numpy as np

from lidaraccum.training.alone import hang_together


def _car(along: float) -> np.ndarray:
    along_, up = np.meshgrid(np.arange(0.0, 4.2, 0.1), np.arange(0.2, 1.4, 0.1))
    return np.column_stack([along + along_.ravel(), np.full(along_.size, 2.0), up.ravel()])


def test_rain_about_a_car_does_not_speak_for_it_and_both_its_halves_do() -> None:
    rain = np.array([[-3.0, 2.0, 1.0], [6.5, 3.0, 1.5], [5.5, 0.0, 0.5]])
    behind_a_pole = _car(0.0)
    behind_a_pole = behind_a_pole[np.abs(behind_a_pole[:, 0] - 2.6) > 1.0]
    frames = [np.concatenate([_car(0.0), rain]), np.concatenate([behind_a_pole, rain])]
    count = [len(one) for one in frames]
    positions, frame = np.concatenate(frames), np.repeat([0, 1], count)
    together = hang_together(positions, np.full(len(frame), 7), frame)
    for one, many in enumerate(count):
        mine = together[frame == one]
        assert mine[: many - 3].all()
        assert not mine[many - 3 :].any()


def test_an_object_of_a_few_points_apart_from_each_other_speaks_all_the_same() -> None:
    few = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    objects, frame = np.array([1, 1, 0]), np.array([0, 0, 0])
    assert hang_together(few, objects, frame).tolist() == [True, True, False]
    assert hang_together(few[:0], objects[:0], frame[:0]).shape == (0,)
