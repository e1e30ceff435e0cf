"""Heights told wrong on purpose: no ground is known better than kerbs, slopes and grass allow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid
from lidaraccum.training.window import TrainingWindow

WAVES = 2
SHORTEST_M, LONGEST_M = 10.0, 60.0
"""Wave lengths of the error: from a driveway to a street."""
BETWEEN_FRAMES = 0.25
"""The part of the error that each frame has to itself, beside the part all frames share."""


def misjudge_ground(
    window: TrainingWindow, error_m: float, rng: np.random.Generator
) -> TrainingWindow:
    """A window whose points' heights are off: by one number, by waves over the scene, by frame.

    Points, poses and the truth stay. The waves stand still in the scene, as a kerb does.

    Args:
        window: As `make_window` made it.
        error_m: One sigma of the number, and of each wave's height.
        rng: Decides.
    """
    lift, *heights = rng.normal(0.0, error_m, 1 + WAVES)
    lengths = rng.uniform(SHORTEST_M, LONGEST_M, WAVES)
    turns, phases = rng.uniform(0.0, 2 * np.pi, (2, WAVES))
    waves = np.stack([np.cos(turns), np.sin(turns)]) * (2 * np.pi / lengths)  # (2, WAVES)
    frames = []
    for frame, pose in zip(window.frames, window.target_from_sensor, strict=True):
        target_from_level = pose @ rigid.invert(frame.level_from_sensor)
        place = rigid.transform(target_from_level, frame.points)[:, :2]
        error: NDArray[np.float64] = np.sin(place @ waves + phases) @ np.array(heights)
        error += lift + rng.normal(0.0, BETWEEN_FRAMES * error_m)
        frames.append(replace(frame, height=(frame.height + error).astype(np.float32)))
    return replace(window, frames=tuple(frames))
