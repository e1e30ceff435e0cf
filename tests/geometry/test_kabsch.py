"""Kabsch finds a known motion: weighted, planar, in spite of mirrors."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.geometry.kabsch import kabsch, planar_kabsch

MOTION = rigid.exponential(np.array([0.3, -0.7, 2.0, 4.0, -1.0, 0.5]))
LEVEL = rigid.exponential(np.array([0.0, 0.0, -2.4, 4.0, -1.0, 0.5]))


def points(count: int = 30) -> np.ndarray:
    return np.random.default_rng(6).normal(0, 3, (count, 3))


def test_a_known_motion_is_found() -> None:
    assert np.allclose(kabsch(points(), rigid.transform(MOTION, points())), MOTION)


def test_a_known_level_motion_is_found() -> None:
    assert np.allclose(planar_kabsch(points(), rigid.transform(LEVEL, points())), LEVEL)


def test_a_level_answer_stays_level() -> None:
    found = planar_kabsch(points(), rigid.transform(MOTION, points()))
    assert np.allclose(found[2, :3], (0, 0, 1))
    assert np.allclose(found[:3, 2], (0, 0, 1))


@pytest.mark.parametrize("solve", [kabsch, planar_kabsch])
def test_points_without_weight_have_no_say(solve: type) -> None:
    source, target = points(), rigid.transform(LEVEL, points())
    target[20:] += 7.0
    weights = np.repeat([1.0, 0.0], [20, 10])
    assert np.allclose(solve(source, target, weights), LEVEL)


def test_flat_points_are_turned_not_mirrored() -> None:
    flat = points() * (1, 1, 0)
    found = kabsch(flat, rigid.transform(MOTION, flat))
    assert np.linalg.det(found[:3, :3]) == pytest.approx(1.0)
    assert np.allclose(rigid.transform(found, flat), rigid.transform(MOTION, flat))


@pytest.mark.parametrize("solve", [kabsch, planar_kabsch])
def test_what_cannot_be_solved_is_refused(solve: type) -> None:
    with pytest.raises(InputError):
        solve(points(3), points(4))
    with pytest.raises(InputError):
        solve(points(3), points(3), np.zeros(3))
