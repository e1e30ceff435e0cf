"""Laws of rigid motions."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry import rigid


@pytest.fixture(params=range(5))
def motion(request: pytest.FixtureRequest) -> rigid.Pose:
    return rigid.exponential(np.random.default_rng(request.param).normal(size=6))


def test_invert_undoes(motion: rigid.Pose) -> None:
    points = np.random.default_rng(9).normal(size=(20, 3)) * 50
    there_and_back = rigid.transform(rigid.invert(motion), rigid.transform(motion, points))
    np.testing.assert_allclose(there_and_back, points, atol=1e-9)


def test_logarithm_undoes_exponential(motion: rigid.Pose) -> None:
    np.testing.assert_allclose(rigid.exponential(rigid.logarithm(motion)), motion, atol=1e-9)


def test_half_a_twist_twice_is_the_whole(motion: rigid.Pose) -> None:
    half = rigid.exponential(rigid.logarithm(motion) / 2)
    np.testing.assert_allclose(half @ half, motion, atol=1e-9)


def test_exponentials_are_exponentials(motion: rigid.Pose) -> None:
    twist = rigid.logarithm(motion)
    scales = np.array([0.0, 0.25, 1.0, -2.0])
    many = rigid.exponentials(twist[None], scales)
    for scale, one in zip(scales, many, strict=True):
        np.testing.assert_allclose(one, rigid.exponential(scale * twist), atol=1e-12)


def test_stacked_inverse_is_the_inverse_of_each(motion: rigid.Pose) -> None:
    stack = np.stack([motion, np.eye(4)])
    np.testing.assert_allclose(rigid.invert(stack) @ stack, np.stack([np.eye(4)] * 2), atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 0.3, 3.0, 7.0])
def test_a_rotation_turns_about_its_axis_by_its_angle(angle: float) -> None:
    axis = np.array([0.6, 0.0, 0.8])
    turn = rigid.rotation(angle * axis)
    np.testing.assert_allclose(turn @ axis, axis, atol=1e-15)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    assert np.trace(turn) == pytest.approx(1 + 2 * np.cos(angle))
    assert np.cross(axis, [0.0, 1.0, 0.0]) @ turn @ [0.0, 1.0, 0.0] == pytest.approx(np.sin(angle))


def test_a_tiny_motion_survives_the_logarithm() -> None:
    twist = np.array([1e-10, 0, 0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(rigid.logarithm(rigid.exponential(twist)), twist, atol=1e-9)
