"""Along a tunnel no plane tells the way: what begins and ends does; where nothing does, doubt."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid
from lidaraccum.registration.odometry import register
from lidaraccum.registration.quality import ADRIFT
from lidaraccum.registration.settings import RegistrationSettings
from lidaraccum.registration.sightlines import Sightlines, gain
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.settings import DriveSettings

FLOOR_Z = -1.7
HERE = np.zeros(3)


def tube(world: Any, pillars: list[float]) -> Any:
    """Walls 4 m either side and a ceiling 4 m up, without end; pillars stand at metres along."""
    boxes = [
        ((-400.0, -5.0, FLOOR_Z), (400.0, -4.0, 6.0)),
        ((-400.0, 4.0, FLOOR_Z), (400.0, 5.0, 6.0)),
        ((-400.0, -5.0, 4.0), (400.0, 5.0, 6.0)),
        *(((x, -4.0, FLOOR_Z), (x + 0.6, -3.2, 4.0)) for x in pillars),
    ]
    low, high = zip(*boxes, strict=True)
    return world.Street(np.array(low), np.array(high))


def noisy(frame: Frame) -> Frame:
    """As measured to 15 mm; exact rings would be planes."""
    ranges = np.linalg.norm(frame.points, axis=1, keepdims=True)
    noise = np.random.default_rng(round(1e3 * frame.stamp)).normal(0.0, 0.015, ranges.shape)
    return Frame((frame.points * (1 + noise / ranges)).astype(np.float32), stamp=frame.stamp)


def test_a_bare_tunnel_is_doubted_in_every_frame(world: Any) -> None:
    moving = world.drive([0, 0, 0, 1.3, 0, 0], scene=tube(world, []), sensor=world.dense)
    _, *others = register([noisy(frame) for frame in moving.frames])
    assert all(ADRIFT in frame.quality.doubts for frame in others)


@pytest.mark.parametrize("seed", [7008, 7029])
def test_a_start_at_speed_in_a_tunnel_is_no_standing_still(seed: int) -> None:
    speed = {7008: 20.0, 7029: 26.0}[seed]
    drive = simulate(DriveSettings(seed=seed, scene="tunnel", speed_mps=speed))
    first, last = (drive.labels(index).world_from_sensor for index in (0, 4))
    found = list(register(drive[index] for index in range(5)))[-1].world_from_sensor
    error = rigid.invert(rigid.invert(first) @ last) @ found
    assert np.linalg.norm(error[:3, 3]) < 0.2


@pytest.mark.parametrize(("lookahead", "spoilt"), [(7, None), (5, 2)])
def test_however_many_frames_open_and_though_one_is_lost(
    lookahead: int, spoilt: int | None
) -> None:
    drive = simulate(DriveSettings(seed=7008, scene="tunnel", speed_mps=20.0, frames=7))
    frames = [drive[index] for index in range(len(drive))]
    if spoilt is not None:
        noise = np.random.default_rng(0).uniform(-60, 60, frames[spoilt].points.shape)
        frames[spoilt] = frames[spoilt].with_points(noise.astype(np.float32))
    found = list(register(frames, RegistrationSettings(lookahead=lookahead)))
    first, last = (drive.labels(index).world_from_sensor for index in (0, 6))
    error = rigid.invert(rigid.invert(first) @ last) @ found[-1].world_from_sensor
    assert np.linalg.norm(error[:3, 3]) < 0.3
    assert spoilt is None or found[spoilt].quality.doubts


def points_of(moving: Any, index: int) -> np.ndarray:
    return np.asarray(moving.frames[index].points, dtype=np.float64)


def test_a_frame_agrees_with_itself_and_with_no_other_place(world: Any) -> None:
    points = points_of(world.drive([0] * 6, count=1), 0)
    seen = Sightlines(points, HERE)
    assert np.nanmean(seen.agreement(points)) > 0.99
    assert np.nanmean(seen.agreement(points * 0.9)) < 0.6
    assert np.isnan(seen.agreement(np.array([[0.1, 0.0, 50.0]]))).all()


def test_a_bare_tube_agrees_with_any_way_along_it_pillars_with_one(world: Any) -> None:
    for pillars in ([], [-9.0, 7.0, 21.0]):
        moving = world.drive([0, 0, 0, 1.3, 0, 0], count=2, scene=tube(world, pillars))
        seen, points = Sightlines(points_of(moving, 0), HERE), points_of(moving, 1)
        true, still, twice = (
            seen.agreement(points + np.array([way, 0.0, 0.0])) for way in (1.3, 0.0, 2.6)
        )
        for other in (still, twice):
            assert (gain(true, other) > 4.0) == bool(pillars)
