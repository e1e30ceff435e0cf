"""Rigid motions as 4 x 4 float64 matrices, named ``to_from``: ``to_from @ points_from``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Pose = NDArray[np.float64]

FEW = 4096
"""A product of so many rows keeps to one BLAS thread and beats going column by column."""


def transform(to_from: Pose, points: NDArray[Any]) -> NDArray[np.float64]:
    """Move points (N, 3), metres, by a rigid motion (4, 4); float64 out, laid out as they are."""
    points = np.asarray(points, dtype=np.float64)
    if len(points) <= FEW:
        return points @ to_from[:3, :3].T + to_from[:3, 3]
    x, y, z = np.ascontiguousarray(points.T)
    moved = np.empty_like(points)
    # Column by column: a product of N x 3 by 3 x 3 wakes every BLAS thread, which costs more than
    # it saves, ten times more when the cores are busy.
    for row, (a, b, c, shift) in enumerate(to_from[:3]):
        moved[:, row] = a * x + b * y + c * z + shift
    return moved


def invert(to_from: Pose) -> Pose:
    """The motion back, from a (4, 4) rigid motion; (T, 4, 4) stacks are inverted one by one."""
    inverse = np.zeros_like(to_from)
    rotation_back = np.swapaxes(to_from[..., :3, :3], -1, -2)
    inverse[..., :3, :3] = rotation_back
    inverse[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation_back, to_from[..., :3, 3])
    inverse[..., 3, 3] = 1.0
    return inverse


def translation(shift: NDArray[Any] | tuple[float, float, float]) -> Pose:
    """The motion (4, 4) that only shifts, metres."""
    motion = np.eye(4)
    motion[:3, 3] = shift
    return motion


def exponential(twist: NDArray[Any]) -> Pose:
    """The motion (4, 4) of a constant twist (6,): rotation vector in radians, velocity in metres.

    Exact on SE(3), so half the twist applied twice is the whole.
    """
    twist = np.asarray(twist, dtype=np.float64)
    angle_axis, velocity = twist[:3], twist[3:]
    angle = math.sqrt(angle_axis @ angle_axis)
    sinc, versine = _sinc_and_versine(angle)
    late = (1.0 - sinc) / angle**2 if angle > 1e-8 else 1.0 / 6.0
    first = crossed(angle_axis, velocity)
    motion = np.eye(4)
    motion[:3, :3] = rotation(angle_axis)
    motion[:3, 3] = velocity + versine * first + late * crossed(angle_axis, first)
    return motion


def exponentials(twists: NDArray[Any], scales: NDArray[Any]) -> NDArray[np.float64]:
    """Motions (M, 4, 4) of twists (M, 6) or (1, 6), each scaled by its own factor (M,)."""
    scaled = np.asarray(twists, dtype=np.float64) * np.asarray(scales, dtype=np.float64)[:, None]
    angle_axis, velocity = scaled[:, :3], scaled[:, 3:]
    angle = np.linalg.norm(angle_axis, axis=1)
    small = angle < 1e-8
    safe = np.where(small, 1.0, angle)
    one_minus_cos = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    angle_minus_sin = np.where(small, 1.0 / 6.0, (safe - np.sin(safe)) / safe**3)
    first = np.cross(angle_axis, velocity)
    second = np.cross(angle_axis, first)
    motions = np.tile(np.eye(4), (len(scaled), 1, 1))
    motions[:, :3, :3] = Rotation.from_rotvec(angle_axis).as_matrix()
    motions[:, :3, 3] = (
        velocity + one_minus_cos[:, None] * first + angle_minus_sin[:, None] * second
    )
    return motions


def rotation(angle_axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """The turn (3, 3) by a rotation vector (3,), radians: a tenth of the stacks' time for one."""
    x, y, z = angle_axis
    turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sinc, versine = _sinc_and_versine(math.sqrt(x * x + y * y + z * z))
    return np.eye(3) + sinc * turn + versine * (turn @ turn)


def _sinc_and_versine(angle: float) -> tuple[float, float]:
    """Sine over angle and one less cosine over its square."""
    if angle < 1e-8:
        return 1.0, 0.5
    return math.sin(angle) / angle, 2.0 * (math.sin(0.5 * angle) / angle) ** 2


def logarithm(to_from: Pose) -> NDArray[np.float64]:
    """The twist (6,) whose exponential is the motion (4, 4): radians, then metres."""
    rotation_vector = _rotation_vector(to_from)
    angle = float(np.linalg.norm(rotation_vector))
    shift = to_from[:3, 3]
    cross = crossed(rotation_vector, shift)
    if angle < 1e-8:
        velocity = shift - 0.5 * cross
    else:
        factor = (1.0 - 0.5 * angle * np.cos(angle / 2) / np.sin(angle / 2)) / angle**2
        velocity = shift - 0.5 * cross + factor * crossed(rotation_vector, cross)
    return np.concatenate([rotation_vector, velocity])


def rotation_angle(to_from: Pose) -> float:
    """Angle of the motion's rotation, radians."""
    return float(np.linalg.norm(_rotation_vector(to_from)))


def crossed(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """The cross product (3,) of two vectors (3,): numpy's own takes ten times as long for one."""
    (a, b, c), (x, y, z) = one, other
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def _rotation_vector(to_from: Pose) -> NDArray[np.float64]:
    """The rotation vector (3,), radians, of a motion (4, 4)."""
    twice = np.array(
        [
            to_from[2, 1] - to_from[1, 2],
            to_from[0, 2] - to_from[2, 0],
            to_from[1, 0] - to_from[0, 1],
        ]
    )
    sine, cosine = 0.5 * math.sqrt(twice @ twice), 0.5 * (np.trace(to_from[:3, :3]) - 1.0)
    if cosine < 0:  # Near half a turn the differences tell no axis.
        return Rotation.from_matrix(to_from[:3, :3]).as_rotvec()
    return 0.5 * twice * (math.atan2(sine, cosine) / sine if sine > 1e-12 else 1.0)
