"""What speaks for an object's motion, and what only lies about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from lidaraccum.model.answers import ObjectMotions
from lidaraccum.model.tubes import gather_tubes
from lidaraccum.training.alone import go_along, hang_together, stand, tower


def _car(along: float) -> np.ndarray:
    along_, up = np.meshgrid(np.arange(0.0, 4.2, 0.1), np.arange(0.2, 1.4, 0.1))
    return np.column_stack([along + along_.ravel(), np.full(along_.size, 2.0), up.ravel()])


def test_rain_about_a_car_does_not_speak_for_it_and_both_its_halves_do() -> None:
    rain = np.array([[-3.0, 2.0, 1.0], [6.5, 3.0, 1.5], [5.5, 0.0, 0.5]])
    behind_a_pole = _car(0.0)
    behind_a_pole = behind_a_pole[np.abs(behind_a_pole[:, 0] - 2.6) > 1.0]
    frames = [np.concatenate([_car(0.0), rain]), np.concatenate([behind_a_pole, rain])]
    count = [len(one) for one in frames]
    positions, frame = np.concatenate(frames), np.repeat([0, 1], count)
    together = hang_together(positions, np.full(len(frame), 7), frame)
    for one, many in enumerate(count):
        mine = together[frame == one]
        assert mine[: many - 3].all()
        assert not mine[many - 3 :].any()


def test_an_object_of_a_few_points_apart_from_each_other_speaks_all_the_same() -> None:
    few = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    objects, frame = np.array([1, 1, 0]), np.array([0, 0, 0])
    assert hang_together(few, objects, frame).tolist() == [True, True, False]
    assert hang_together(few[:0], objects[:0], frame[:0]).shape == (0,)


def _objects(
    middle: torch.Tensor, velocity: torch.Tensor, height: float = 1.5
) -> tuple[ObjectMotions, torch.Tensor]:
    """One, seen four times, a tenth of a second apart, about (T, 3) places; its points."""
    lot = torch.rand(4, 200, 3, generator=torch.Generator().manual_seed(0)) - 0.5
    points = (middle[:, None] + lot * torch.tensor([4.0, 1.5, height])).flatten(0, 1)
    time = torch.arange(4).repeat_interleave(200)
    zero = torch.zeros(800, dtype=torch.int64)
    tubes = gather_tubes(points, zero, time, 0.1 * time, zero[:1], 1)
    motion = torch.eye(4).repeat(1, 4, 1, 1)
    motion[0, :, :3, 3] = -0.1 * torch.arange(4)[:, None] * velocity
    ids = torch.ones(1, dtype=torch.int64)
    return ObjectMotions(ids, zero[:1], zero, time, tubes, None, motion), points


@pytest.mark.parametrize(("speed", "stands"), [(0.0, True), (0.4, True), (0.6, False)])
def test_what_is_said_to_creep_stands(speed: float, stands: bool) -> None:
    velocity = torch.tensor([0.6, 0.8, 0.0]) * speed
    there = torch.tensor([8.0, 2.0, 0.0]) + 0.1 * torch.arange(4)[:, None] * velocity
    assert stand(_objects(there, velocity)[0]).tolist() == [stands]


@pytest.mark.parametrize(
    ("aside", "own", "other", "along"),
    [(0.0, 9.0, 9.0, True), (3.0, 9.0, 9.0, False), (0.0, 9.0, 5.0, False), (0.0, 0.0, 0.0, False)],
)
def test_spray_about_the_sensor_goes_along_and_a_car_beside_does_not(
    aside: float, own: float, other: float, along: bool
) -> None:
    ahead = torch.tensor([1.0, 0.0, 0.0])
    sensors = 0.1 * own * torch.arange(4)[:, None] * ahead
    middle = sensors + torch.tensor([0.5, aside, 0.0])
    objects, points = _objects(middle, other * ahead)
    assert go_along(objects, points, sensors).tolist() == [along]


@pytest.mark.parametrize(("height", "tall"), [(1.5, False), (4.2, False), (6.0, True)])
def test_a_wall_is_taller_than_what_drives(height: float, tall: bool) -> None:
    places = torch.tensor([20.0, 3.0, 0.0]).expand(4, 3)
    objects, points = _objects(places, torch.zeros(3), height)
    assert tower(objects).tolist() == [tall]
    points[::100, 2] += 9.0  # rain above it
    high = gather_tubes(
        points, objects.instance, objects.time, 0.1 * objects.time, objects.window, 1
    )
    assert tower(replace(objects, tubes=high)).tolist() == [tall]
