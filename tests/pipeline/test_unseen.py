"""What nobody saw through: nothing moves with all about it; what is close is its mover's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lidaraccum.data.accumulation import MOVING
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.geometry import rigid
from lidaraccum.pipeline.label_free import LabelFree
from lidaraccum.registration.odometry import register
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.windows import held_out_settings


def found(frames: Sequence[RegisteredFrame], on: Sequence[np.ndarray]) -> tuple[float, float]:
    """Share of the movers' points that are called moving, and of all others."""
    moving = [perceived.label == MOVING for perceived in LabelFree().perceive(frames)]
    called, truly = np.concatenate(moving), np.concatenate(on) > 0
    share = float(called[truly].mean()) if truly.any() else 0.0
    return share, float(called[~truly].mean())


def test_a_slipped_pose_moves_nothing(look: Any) -> None:
    street = look([], count=5)
    slipped = [
        replace(
            frame,
            world_from_sensor=rigid.translation((0.1 * index, 0.06 * index, 0.0))
            @ frame.world_from_sensor,
        )
        for index, frame in enumerate(street.frames)
    ]
    _, wrong = found(slipped, street.on)
    assert wrong < 0.002


def test_a_mover_keeps_what_is_as_close_as_the_carrier(look: Any, new_mover: Any) -> None:
    """A van overtakes at arm's length: half of it is nearer than what may be the own car."""
    van = new_mover(low=(-9.0, 1.5, 0.2), size=(5.0, 1.9, 2.2), velocity=(18.0, 0.0, 0.0))
    street = look([van], count=9, speed=6.0)
    near = [
        np.where(np.linalg.norm(frame.frame.points, axis=1) < 2.5, on, 0)
        for frame, on in zip(street.frames, street.on, strict=True)
    ]
    assert np.concatenate(near).sum() > 500
    share, _ = found(street.frames, near)
    assert share > 0.5


def test_dense_traffic_moves_though_a_pose_is_doubtful() -> None:
    """A motorway on which a third of what stands out goes; the rest does not go along with it."""
    drive = simulate(held_out_settings(141, 5))
    frames = list(register(drive[index] for index in range(len(drive))))
    assert any(frame.quality.doubts for frame in frames)
    moving = np.concatenate([frame.label == MOVING for frame in LabelFree().perceive(frames)])
    truth = np.concatenate([drive.labels(index).dynamic for index in range(len(drive))])
    assert moving[truth].mean() > 0.7
    assert moving[~truth].mean() < 0.005
