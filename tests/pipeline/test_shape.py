"""Points that were put a little wrong find their shape; those put right stay."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.pipeline.shape import ObjectShape


def corner(count: int = 900, seed: int = 0) -> np.ndarray:
    """Points on two upright sides of a car, with 1 cm of noise."""
    rng = np.random.default_rng(seed)
    side = rng.uniform((-2, 0.9, 0), (2, 0.9, 1.4), (2 * count // 3, 3))
    back = rng.uniform((-2, -0.9, 0), (-2, 0.9, 1.4), (count // 3, 3))
    return np.concatenate([side, back]) + rng.normal(0, 0.01, (count, 3))


@pytest.mark.parametrize(
    "twist",
    [(0, 0, 0.03, 0.12, -0.08, 0.0), (0, 0, -0.04, -0.15, 0.1, 0.03), (0, 0, 0, 0, 0.2, 0)],
)
def test_a_small_error_is_undone(twist: tuple[float, ...]) -> None:
    wrong = rigid.exponential(np.array(twist))
    fit = ObjectShape(corner()).fit(rigid.transform(wrong, corner(seed=1)))
    left = fit.correction @ wrong
    assert np.abs(left[:2, 3]).max() < 0.04
    assert rigid.rotation_angle(left) < 0.015
    assert fit.residual_m < 0.02


def test_what_fits_is_left_alone() -> None:
    fit = ObjectShape(corner()).fit(corner(seed=1))
    assert np.abs(fit.correction[:3, 3]).max() < 0.02


def test_a_flat_back_does_not_slide() -> None:
    back = corner()[600:]
    shifted = back + np.array([0.0, 0.08, 0.0])
    fit = ObjectShape(back).fit(shifted[shifted[:, 1] < 0.7])
    assert abs(fit.correction[0, 3]) < 0.02
    assert abs(fit.correction[1, 3]) < 0.09


def test_what_lies_elsewhere_is_not_pulled_over() -> None:
    fit = ObjectShape(corner()).fit(corner(seed=1) + np.array([5.0, 0.0, 0.0]))
    assert np.allclose(fit.correction, np.eye(4))


def test_a_shape_grows_by_what_is_new_only() -> None:
    shape = ObjectShape(corner()[:600])
    before = len(shape)
    shape.add(corner()[:600])
    assert len(shape) < 1.1 * before
    shape.add(corner(seed=2)[600:])
    assert len(shape) > 1.2 * before
