"""How far objects have gone, by what of them overlaps with itself."""

from __future__ import annotations

import math

import pytest
import torch

from lidaraccum.model.overlap import ROUNDS, Overlap
from lidaraccum.model.quaternion import about_vertical, rotation_of
from lidaraccum.model.tubes import Tubes, centroid_gap, gather_tubes

CHANNELS = 16
TIMES = 5
SECONDS = 0.1
PLACE = torch.tensor([2.0, 4.0, 0.5])
VELOCITY = torch.tensor([9.0, 0.0, 0.0])


def _lorry(seed: int) -> torch.Tensor:
    """(N, 3) points of the near side of a lorry 12 m long: its bed, and posts that stand on it."""
    lot = torch.Generator().manual_seed(seed)
    bed = (torch.rand(1500, 3, generator=lot) - 0.5) * torch.tensor([12.0, 0.0, 0.3])
    posts = []
    for at in (-5.1, -3.7, -2.9, -0.4, 0.9, 1.5, 3.4, 5.6):
        post = (torch.rand(80, 3, generator=lot) - 0.5) * torch.tensor([0.12, 0.0, 1.6])
        posts.append(post + torch.tensor([at, 0.0, 1.0]))
    return torch.cat([bed, *posts])


def _passing(turn_rad: float = 0.0, view_m: float = 4.0) -> Tubes:
    """A lorry that passes, of which only what is before the sensor is seen; the scene turned."""
    frames = []
    for time in range(TIMES):
        points = _lorry(time) + PLACE + VELOCITY * SECONDS * (time - 2)
        frames.append(points[(points[:, 0] - 2.0).abs() < view_m])
    return _tubes(frames, turn_rad)


def _tubes(frames: list[torch.Tensor], turn_rad: float = 0.0) -> Tubes:
    count = torch.tensor([len(one) for one in frames])
    time_of = torch.repeat_interleave(torch.arange(TIMES), count)
    turn = rotation_of(about_vertical(torch.tensor([turn_rad])))[0]
    zero = torch.zeros(len(time_of), dtype=torch.int64)
    return gather_tubes(
        torch.cat(frames) @ turn.T, zero, time_of, SECONDS * time_of, zero[:1], 1
    )  # fmt: skip


def _laid(tubes: Tubes, told: torch.Tensor) -> torch.Tensor:
    """(T, 3) what a fresh net adds to what has been told (T, 3) of how far the object went."""
    torch.manual_seed(0)
    overlap = Overlap(CHANNELS)
    moved = tubes.relative + told[tubes.time]
    with torch.no_grad():
        return overlap(tubes, torch.zeros(1, TIMES, CHANNELS), moved, told[None])[0]


def _gone(share: float) -> torch.Tensor:
    return -share * VELOCITY * SECONDS * torch.arange(TIMES)[:, None]


@pytest.mark.parametrize("told", [0.6, 0.85, 1.0, 1.3])
def test_posts_tell_how_far_a_lorry_went_of_which_the_ends_are_never_seen(told: float) -> None:
    tubes = _passing()
    assert centroid_gap(tubes.relative, tubes).norm(dim=2).max() < 0.3  # that it stands, they say
    error = _gone(told) + _laid(tubes, _gone(told)) - _gone(1.0)
    assert error.norm(dim=1).max() < 0.1


def test_a_bare_wall_tells_nothing_and_goes_as_it_was_told() -> None:
    lot = torch.Generator().manual_seed(0)
    frames = []
    for _ in range(TIMES):
        bare = (torch.rand(3000, 3, generator=lot) - 0.5) * torch.tensor([30.0, 0.0, 1.5])
        frames.append(bare + torch.tensor([2.0, 4.0, 1.0]))
    added = _laid(_tubes(frames), _gone(0.9))
    assert added.norm(dim=1).max() < 0.35


def test_what_sideslips_and_rises_is_laid_back() -> None:
    tubes = _passing()
    aside = torch.tensor([0.0, 0.3, 0.15]) * torch.linspace(0.0, 1.0, TIMES)[:, None]
    error = _laid(tubes, _gone(1.0) + aside) + aside
    assert error.norm(dim=1).max() < 0.08


@pytest.mark.parametrize("turn_rad", [0.5, 0.5 * math.pi, -2.0])
def test_a_turned_scene_has_turned_ways(turn_rad: float) -> None:
    turn = rotation_of(about_vertical(torch.tensor([turn_rad])))[0]
    straight = _laid(_passing(), _gone(0.8))
    turned = _laid(_passing(turn_rad), _gone(0.8) @ turn.T)
    assert (turned - straight @ turn.T).norm(dim=1).max() < 0.2  # of 0.72; cells lie otherwise


def test_of_few_points_and_of_one_time_nothing_is_told() -> None:
    whole = _passing()
    few = [whole.relative[whole.time == time][:9] for time in range(TIMES)]
    assert _laid(_tubes(few), _gone(0.6)).abs().max() < 1e-4
    once = [whole.relative[whole.time == 2] if time == 2 else few[0][:0] for time in range(TIMES)]
    assert _laid(_tubes(once), _gone(0.6)[:3]).abs().max() == 0.0


def test_the_anchor_and_who_does_not_go_anywhere_stay() -> None:
    tubes = _passing()
    assert _laid(tubes, _gone(0.6))[0].abs().max() == 0.0
    still = _laid(tubes, _gone(0.0))
    assert still[:, :2].abs().max() == 0.0  # along and across what way?


def test_many_objects_are_laid_as_each_alone() -> None:
    one = _passing()
    count = 70
    many = Tubes(
        instance=torch.arange(count).repeat_interleave(len(one.instance)),
        time=one.time.repeat(count),
        anchor=one.anchor.repeat(count, 1),
        anchor_time=one.anchor_time.repeat(count),
        counts=one.counts.repeat(count, 1),
        relative=one.relative.repeat(count, 1),
        seconds=one.seconds.repeat(count),
    )
    torch.manual_seed(0)
    overlap = Overlap(CHANNELS)
    told = _gone(0.8)
    with torch.no_grad():
        added = overlap(
            many,
            torch.zeros(count, TIMES, CHANNELS),
            many.relative + told[many.time],
            told.expand(count, TIMES, 3),
        )
    expected = _laid(one, told).expand_as(added)
    torch.testing.assert_close(added, expected, atol=1e-4, rtol=0)


def test_each_round_learns_how_much_its_agreement_counts() -> None:
    tubes = _passing()
    torch.manual_seed(0)
    overlap = Overlap(CHANNELS)
    told = _gone(0.7)
    said = torch.zeros(1, TIMES, CHANNELS)
    added = overlap(tubes, said, tubes.relative + told[tubes.time], told[None])
    (told + added[0] - _gone(1.0)).square().sum().backward()
    for say in overlap.say:
        assert say[-1].bias.grad.abs().max() > 0.0
    assert len(overlap.say) == len(ROUNDS)
