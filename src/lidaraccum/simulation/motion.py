"""Where something is at any time: trajectories sampled finely, linear between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP_S = 0.05
"""Time between two samples of a trajectory."""
MARGIN_S = 0.4
"""What trajectories reach beyond the first and the last stamp."""


def poses_of(places: Array, angles: Array) -> Array:
    """Poses (M, 4, 4) from places (M, 3), metres, and yaw, pitch, roll (M, 3), radians.

    Yaw about z, then pitch about y (positive: nose down), then roll about x.
    """
    cos, sin = np.cos(angles), np.sin(angles)
    cy, cp, cr = cos.T
    sy, sp, sr = sin.T
    poses = np.zeros((len(places), 4, 4))
    poses[:, 0, :3] = np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], axis=1)
    poses[:, 1, :3] = np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], axis=1)
    poses[:, 2, :3] = np.stack([-sp, cp * sr, cp * cr], axis=1)
    poses[:, :3, 3] = places
    poses[:, 3, 3] = 1.0
    return poses


def sample_times(duration_s: float) -> Array:
    """Times of a trajectory's samples for a drive of so many seconds."""
    count = int(np.ceil((duration_s + 2 * MARGIN_S) / STEP_S)) + 1
    return -MARGIN_S + STEP_S * np.arange(count, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A rigid motion over time.

    Attributes:
        times: (K,) seconds, equally spaced.
        places: (K, 3) float64 metres, world.
        angles: (K, 3) yaw (unwrapped), pitch, roll in radians.
        travelled: (K,) metres gone along the way.
    """

    times: Array
    places: Array
    angles: Array
    travelled: Array

    def _between(self, values: Array, times: Array) -> Array:
        position = np.clip((times - self.times[0]) / STEP_S, 0, len(self.times) - 1.000001)
        low = position.astype(np.int64)
        share = position - low
        if values.ndim > 1:
            share = share[:, None]
        return values[low] * (1 - share) + values[low + 1] * share

    def place_at(self, times: Array) -> Array:
        """Places (M, 3) at times (M,)."""
        return self._between(self.places, np.asarray(times))

    def poses_at(self, times: Array) -> Array:
        """Poses world_from_object (M, 4, 4) at times (M,) in seconds."""
        times = np.asarray(times)
        return poses_of(self._between(self.places, times), self._between(self.angles, times))

    def speed_at(self, time: float) -> float:
        """Metres a second over ground, about a time."""
        before, after = self.place_at(np.array([time - STEP_S, time + STEP_S]))
        return float(np.linalg.norm(after - before) / (2 * STEP_S))

    def travelled_at(self, time: float) -> float:
        """Metres gone by a time."""
        return float(self._between(self.travelled, np.array([time]))[0])


def speed_profile(
    times: Array, speed: float, manoeuvre: str, rng: np.random.Generator, limit: float = 45.0
) -> Array:
    """Speeds (K,) in m/s at times (K,).

    Args:
        times: Seconds.
        speed: At the start.
        manoeuvre: One of ``MANOEUVRES``.
        rng: What is drawn comes from here.
        limit: Never faster.
    """
    end = max(float(times[-1]), 0.5)
    begins, rate = rng.uniform(-0.2, 0.6) * end, rng.uniform(0.8, 3.5)
    after = np.clip(times - begins, 0, None)
    if manoeuvre == "brake":
        speeds = speed - rate * after
    elif manoeuvre == "accelerate":
        speeds = np.minimum(speed + 0.7 * rate * after, speed + 9)
    elif manoeuvre == "pull away":
        speeds = np.minimum(0.7 * rate * np.clip(times - max(begins, 0.1), 0, None), 12.0)
    elif manoeuvre == "stand":
        speeds = np.zeros_like(times)
    else:
        swing = rng.uniform(0, 0.04) * speed
        speeds = speed + swing * np.sin(2 * np.pi * times / rng.uniform(3, 9))
    return np.clip(speeds, 0.0, limit)


MANOEUVRES = ("cruise", "brake", "accelerate", "pull away", "stand")
"""What a driver does with the speed."""


def distance_of(times: Array, speeds: Array) -> Array:
    """Metres (K,) gone since time zero."""
    steps = 0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)
    gone = np.concatenate([[0.0], np.cumsum(steps)])
    return gone - np.interp(0.0, times, gone)
