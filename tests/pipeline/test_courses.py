"""Laws of a course: straight on without a turn, round a circle with one, and back again."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.pipeline.courses import course, turned, way

VELOCITY = np.array([6.0, 2.0, 0.0])
PIVOT = np.array([10.0, -4.0, 1.0])


def test_without_a_turn_it_goes_straight_on() -> None:
    np.testing.assert_allclose(course(PIVOT, VELOCITY, 0.0, 0.5), rigid.translation(VELOCITY / 2))


def test_a_whole_turn_ends_where_it_began() -> None:
    np.testing.assert_allclose(course(PIVOT, VELOCITY, 2 * np.pi, 1.0), np.eye(4), atol=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.0])
def test_two_steps_are_one(turn: float) -> None:
    first = course(PIVOT, VELOCITY, turn, 0.3)
    there = rigid.transform(first, PIVOT[None])[0]
    second = course(there, turned(VELOCITY, 0.3 * turn), turn, 0.5)
    np.testing.assert_allclose(second @ first, course(PIVOT, VELOCITY, turn, 0.8), atol=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.0])
def test_back_in_time_undoes(turn: float) -> None:
    there = PIVOT + way(VELOCITY, turn, 0.4)
    back = course(there, turned(VELOCITY, 0.4 * turn), turn, -0.4)
    np.testing.assert_allclose(back @ course(PIVOT, VELOCITY, turn, 0.4), np.eye(4), atol=1e-9)
