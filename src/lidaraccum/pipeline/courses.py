"""Where a thing goes that keeps its speed and its rate of turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid


def turned(velocity: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """A velocity (3,) turned about the upright axis, radians."""
    if angle == 0:
        return velocity
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, z = velocity
    return np.array([cosine * x - sine * y, sine * x + cosine * y, z])


def way(velocity: NDArray[np.float64], turn: float, seconds: float) -> NDArray[np.float64]:
    """Way (3,) gone after so many seconds (or before, when negative), metres.

    Args:
        velocity: (3,) m/s at the start.
        turn: Radians a second about the upright axis, of the thing and of its velocity.
        seconds: How long.
    """
    half = 0.5 * turn * seconds
    # An arc's chord: half way into the turn, shorter than the arc.
    return turned(velocity, half) * (seconds * float(np.sinc(half / np.pi)))


def are_alike(
    one: NDArray[np.float64], other: NDArray[np.float64], speed_mps: float, share: float
) -> bool:
    """Whether velocities (3,) differ by less than a speed and a share of the first one's."""
    allowed = speed_mps + share * float(np.linalg.norm(one))
    return bool(np.linalg.norm(other - one) < allowed)


def course(
    pivot: NDArray[np.float64], velocity: NDArray[np.float64], turn: float, seconds: float
) -> rigid.Pose:
    """The motion (4, 4), world, of a thing whose point ``pivot`` (3,) starts with a velocity."""
    motion = np.eye(4)
    motion[:3, 0] = turned(motion[:3, 0], turn * seconds)
    motion[:3, 1] = turned(motion[:3, 1], turn * seconds)
    motion[:3, 3] = pivot + way(velocity, turn, seconds) - motion[:3, :3] @ pivot
    return motion
