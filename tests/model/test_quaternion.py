"""Rotations as quaternions."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from lidaraccum.model.quaternion import quaternion_of, rotation_of


def rotations() -> np.ndarray:
    half_turn = Rotation.from_rotvec([[0, 0, np.pi], [np.pi, 0, 0], [0, 0, 0]]).as_matrix()
    return np.concatenate([Rotation.random(20, random_state=0).as_matrix(), half_turn])


def test_a_quaternion_is_its_rotation() -> None:
    matrices = torch.from_numpy(rotations())
    torch.testing.assert_close(rotation_of(3.0 * quaternion_of(matrices)), matrices)


def test_quaternions_are_those_of_scipy() -> None:
    theirs = np.roll(Rotation.from_matrix(rotations()).as_quat(), 1, axis=1)
    ours = quaternion_of(torch.from_numpy(rotations())).numpy()
    assert (ours[:, 0] >= 0).all()
    assert np.abs(np.sum(ours * theirs, axis=1)) == pytest.approx(1.0)


def test_the_gradient_is_that_of_differences() -> None:
    quaternion = torch.randn(3, 4).double().requires_grad_()
    assert torch.autograd.gradcheck(rotation_of, (quaternion,))
