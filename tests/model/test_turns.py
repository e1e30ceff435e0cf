"""How objects turn, by their sides, and their bent ways laid straight."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lidaraccum.model.bends import bend_of, bent, unbent
from lidaraccum.model.quaternion import about_vertical, rotation_of
from lidaraccum.model.tube_net import turn_in_place
from lidaraccum.model.tubes import Tubes, centre_by_time, gather_tubes, one_of_each_cell
from lidaraccum.model.turns import SideTurn

CHANNELS = 16
TIMES = 5
SECONDS = 0.1


def _two_sides(count: int, seed: int) -> torch.Tensor:
    """(2 count, 3): the left side and the rear of a car about the origin."""
    lot = torch.rand(2 * count, 3, generator=torch.Generator().manual_seed(seed)) - 0.5
    places = lot * torch.tensor([4.4, 1.8, 1.4])
    places[:count, 1], places[count:, 0] = 0.9, -2.2
    return places


def _driving(rate: float, seen: int = 400, speed: float = 6.0) -> tuple[Tubes, torch.Tensor]:
    """A car that turns at a rate, rad/s, seen 5 times, more and more of it; its yaws (5,)."""
    yaw = rate * SECONDS * torch.arange(TIMES)
    frames = []
    for time in range(TIMES):
        half = torch.tensor(0.5 * rate * SECONDS * time)
        chord = torch.sinc(half / torch.pi) * speed * SECONDS * time
        place = torch.tensor([8.0, 3.0, 0.0])
        place[:2] += chord * torch.stack([torch.cos(half), torch.sin(half)])
        sides = _two_sides(seen + 100 * time, time)
        frames.append(sides @ rotation_of(about_vertical(yaw[time])).T + place)
    count = torch.tensor([len(one) for one in frames])
    time_of = torch.repeat_interleave(torch.arange(TIMES), count)
    zero = torch.zeros(len(time_of), dtype=torch.int64)
    tubes = gather_tubes(torch.cat(frames), zero, time_of, SECONDS * time_of, zero[:1], 1)
    return tubes, yaw


@pytest.mark.parametrize("rate", [-0.8, -0.3, 0.4, 0.9])
def test_a_fresh_net_sees_a_car_turn(rate: float) -> None:
    tubes, yaw = _driving(rate)
    with torch.no_grad():
        turn = SideTurn(CHANNELS)(tubes, torch.zeros(1, TIMES, CHANNELS), tubes.relative)
    assert (turn[0] + yaw).abs().max() < np.deg2rad(2.0)


def test_a_car_that_drives_straight_on_does_not_turn() -> None:
    tubes, _ = _driving(0.0)
    with torch.no_grad():
        turn = SideTurn(CHANNELS)(tubes, torch.zeros(1, TIMES, CHANNELS), tubes.relative)
    assert turn.abs().max() < np.deg2rad(0.5)


def test_of_few_points_no_turn_is_told() -> None:
    tubes, _ = _driving(0.9, seen=0)
    few = gather_tubes(
        tubes.relative[::60], tubes.instance[::60], tubes.time[::60], tubes.seconds[::60],
        torch.zeros(1, dtype=torch.int64), 1,
    )  # fmt: skip
    assert int(few.counts.max()) < 20
    with torch.no_grad():
        turn = SideTurn(CHANNELS)(few, torch.zeros(1, TIMES, CHANNELS), few.relative)
    assert turn.abs().max() < 1e-3


@pytest.mark.parametrize("rate", [-0.9, 0.0, 0.6])
def test_a_steady_way_round_a_bend_is_laid_straight(rate: float) -> None:
    seconds = SECONDS * torch.arange(TIMES)
    yaw = rate * seconds
    half = 0.5 * yaw
    chord = 6.0 * seconds * torch.sinc(half / torch.pi)
    way = -torch.stack([chord * torch.cos(half), chord * torch.sin(half), 0.3 * seconds], dim=1)
    bend = bend_of(rotation_of(about_vertical(-yaw)))
    straight = unbent(way, bend)
    steady = torch.tensor([-6.0, 0.0, -0.3]) * seconds[:, None]
    torch.testing.assert_close(straight, steady, atol=1e-4, rtol=0)
    torch.testing.assert_close(bent(straight, bend), way, atol=1e-5, rtol=0)


def test_who_turns_in_place_stays_there() -> None:
    tubes, yaw = _driving(0.7)
    turn = rotation_of(about_vertical(-yaw))[None]
    turned, aside = turn_in_place(turn, tubes.relative, tubes)
    before = centre_by_time(tubes.relative, tubes)
    torch.testing.assert_close(centre_by_time(turned, tubes), before, atol=1e-4, rtol=0)
    about_anchor = (turn[0, tubes.time] @ tubes.relative[..., None])[..., 0] + aside[0, tubes.time]
    torch.testing.assert_close(turned, about_anchor, atol=1e-4, rtol=0)


def test_one_point_of_each_cell_of_each_object_is_kept() -> None:
    places = torch.tensor([[0.01, 0, 0], [0.02, 0, 0], [0.01, 0, 0], [-0.01, 0, 0], [9.0, 9, 9]])
    slot = torch.tensor([0, 0, 1, 0, 0])
    assert one_of_each_cell(places, slot, 0.15).tolist() == [0, 2, 3, 4]
    assert one_of_each_cell(places[:0], slot[:0], 0.15).tolist() == []
    dense = torch.rand(50000, 3, generator=torch.Generator().manual_seed(0))
    kept = one_of_each_cell(dense, torch.zeros(50000, dtype=torch.int64), 0.25)
    assert len(kept) == 64
