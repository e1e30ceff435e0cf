"""All hypotheses at once land in all frames at once where each would alone."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame, RegistrationQuality
from lidaraccum.geometry import rigid
from lidaraccum.pipeline.courses import course
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.landing import Lineup
from lidaraccum.pipeline.motion_settings import BALANCED
from lidaraccum.pipeline.suspects import Template


def frame_at(stamp: float, *, timed: bool) -> SightedFrame:
    """A wall around the sensor, which looks a bit aside."""
    rng = np.random.default_rng(0)
    angle = rng.uniform(-np.pi, np.pi, 4000)
    height = rng.uniform(-1.5, 2.0, 4000)
    wall = np.column_stack([12 * np.cos(angle), 12 * np.sin(angle), height]).astype(np.float32)
    seconds = (0.1 * (angle / (2 * np.pi))).astype(np.float32) if timed else None
    registered = RegisteredFrame(
        1,
        Frame(wall, stamp),
        rigid.exponential(np.array([0.0, 0.02, 0.3, 2.0, -1.0, 0.1])),
        RegistrationQuality("given", 1.0, 0.0),
        seconds_from_stamp=seconds,
    )
    return SightedFrame(registered, BALANCED)


def landed_alone(
    template: Template, velocity: np.ndarray, turn: float, frame: SightedFrame
) -> np.ndarray:
    """Step by step: along the course, into the frame, and on while the sweep takes its time."""
    course_of_it = course(template.pivot, velocity, turn, frame.stamp - template.stamp)
    local = rigid.transform(frame.sensor_from_world @ course_of_it, template.world)
    later = frame.seconds_at(local) - template.seconds if frame.is_timed else np.zeros(len(local))
    return local + later[:, None] * (velocity @ frame.sensor_from_world[:3, :3].T)


@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize("turns", [(0.0, 0.0, 0.0), (0.0, 0.4, -1.0)])
def test_hypotheses_land_as_each_alone(timed: bool, turns: tuple[float, ...]) -> None:
    rng = np.random.default_rng(1)
    world = rng.normal((6.0, 3.0, 0.0), 1.0, (20, 3))
    template = Template(world, world[:, 2], 0.0, rng.uniform(0, 0.05, 20), world.mean(axis=0))
    velocities = np.array([(0.0, 0.0, 0.0), (8.0, -2.0, 0.0), (-3.0, 5.0, 0.0)])
    frames = [frame_at(0.3, timed=timed), frame_at(-0.2, timed=timed), frame_at(0.1, timed=False)]
    landed = Lineup(frames).land(template, velocities, np.array(turns))
    for place, frame in enumerate(frames):
        for row, (velocity, turn) in enumerate(zip(velocities, turns, strict=True)):
            alone = landed_alone(template, velocity, turn, frame)
            np.testing.assert_allclose(landed[:, place, row].T, alone, atol=1e-9)
