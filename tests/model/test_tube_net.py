"""How far objects have gone, by their edges and by steady motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from lidaraccum.errors import SettingsError
from lidaraccum.geometry import rigid
from lidaraccum.model.edges import DIRECTIONS, EdgeShift, StraightOn
from lidaraccum.model.settings import TUBES, NetworkSettings
from lidaraccum.model.tube_net import TubeNet
from lidaraccum.model.tubes import Tubes, centroid_gap, gather_tubes

CHANNELS = 16
VELOCITY = torch.tensor([6.0, 2.0, 0.1])


def car(seed: int = 0) -> torch.Tensor:
    """(200, 3) points of a box about (12, 5, 0.7), metres."""
    lot = torch.rand(200, 3, generator=torch.Generator().manual_seed(seed)) - 0.5
    return lot * torch.tensor([4.2, 1.8, 1.4]) + torch.tensor([12.0, 5.0, 0.7])


def tubes_of(seen: list[torch.Tensor], turn: torch.Tensor | None = None) -> Tubes:
    """One object seen at times 0, 0.1, ..., the first the target; all turned."""
    count = torch.tensor([len(one) for one in seen])
    time = torch.repeat_interleave(torch.arange(len(seen)), count)
    points = torch.cat(seen)
    if turn is not None:
        points = points @ turn.T
    zero = torch.zeros(len(points), dtype=torch.int64)
    return gather_tubes(points, zero, time, 0.1 * time, zero[:1], 1)


def about_z(steps: int) -> torch.Tensor:
    """(3, 3) a turn by so many of the edges' directions."""
    angle = 2.0 * np.pi * steps / DIRECTIONS
    return torch.from_numpy(
        rigid.exponential(np.array([0.0, 0.0, angle, 0.0, 0.0, 0.0]))[:3, :3]
    ).float()


def drawn(module: torch.nn.Module, seed: int = 3) -> torch.nn.Module:
    """The module with weights as if it had learned something or other."""
    lot = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.copy_(torch.randn(parameter.shape, generator=lot))
    return module


def trust_all_alike(edges: EdgeShift) -> None:
    """And let the first channel of their circumstances through to what decides."""
    with torch.no_grad():
        for layer in (edges.told, edges.seen, *edges.trust, edges.centre):
            for parameter in layer.parameters():
                parameter.zero_()
        edges.trust[1].weight[0, 0] = 1.0


@pytest.mark.parametrize("tube", TUBES)
def test_a_fresh_net_knows_how_far_a_car_seen_whole_has_gone(tube: str) -> None:
    settings = NetworkSettings(tube=tube)
    net = TubeNet(settings)
    tubes = tubes_of([car() + VELOCITY * 0.1 * time for time in range(4)])
    features = torch.zeros(800, settings.point_channels), torch.zeros(800, settings.base_widths[0])
    motion = net(tubes, *features).anchor_from_time[-1][0]
    wanted = -VELOCITY * 0.1 * torch.arange(4)[:, None]
    torch.testing.assert_close(motion[:, :3, 3], wanted, atol=2e-3, rtol=0)
    torch.testing.assert_close(motion[:, :3, :3], torch.eye(3).expand(4, 3, 3), atol=2e-3, rtol=0)


def test_edges_that_are_trusted_outweigh_a_centroid_that_wanders() -> None:
    """Of a car that goes on, less and less is seen from behind: its rear still tells the way."""
    whole = car()
    seen = [whole + VELOCITY * 0.1 * time for time in range(3)]
    rear = [one[one[:, 0] < one[:, 0].max() - 0.6 * time] for time, one in enumerate(seen)]
    tubes = tubes_of(rear)
    edges = EdgeShift(CHANNELS)
    trust_all_alike(edges)
    with torch.no_grad():
        # What lies along the shift, the third circumstance, is trusted: the rear.
        edges.seen.weight[0, 2] = 1.0
        edges.seen.weight[0, 9] = -10.0  # and the outermost the rather
        edges.trust[3].weight[0, 0] = 50.0
    shift = edges(tubes, torch.zeros(1, 3, CHANNELS), tubes.relative, torch.zeros(1, 3, 3))
    way = VELOCITY[:2] / VELOCITY[:2].norm()
    wanted = -VELOCITY[:2].norm() * torch.tensor([0.1, 0.2])
    by_edges = shift[0, 1:, :2] @ way
    by_centroid = centroid_gap(tubes.relative, tubes)[0, 1:, :2] @ way
    assert (by_edges - wanted).abs().max() < 0.03
    assert (by_centroid - wanted).abs().min() > 0.2


@pytest.mark.parametrize(("sign", "errs"), [(-1.0, True), (1.0, False)])
def test_strays_shift_the_outermost_edge_and_not_what_lies_within(sign: float, errs: bool) -> None:
    whole = car()
    strays = whole[:5] + torch.tensor([6.0, 0.0, 0.0])
    tubes = tubes_of([whole, torch.cat([whole + 0.1 * VELOCITY, strays])])
    edges = EdgeShift(CHANNELS)
    trust_all_alike(edges)
    with torch.no_grad():  # but rather where few of the points lie beyond, or where many do
        edges.seen.bias[0] = 1.0
        edges.seen.weight[0, 9] = 100.0 * sign
        edges.trust[3].weight[0, 0] = 10.0
        shift = edges(tubes, torch.zeros(1, 2, CHANNELS), tubes.relative, torch.zeros(1, 2, 3))
    error = (shift[0, 1, :2] + 0.1 * VELOCITY[:2]).norm()
    assert error > 1.0 if errs else error < 0.06


@pytest.mark.parametrize("steps", [1, 4, 7])
def test_a_turned_scene_has_turned_shifts(steps: int) -> None:
    """Whatever has been learned: no direction is another's better."""
    edges = drawn(EdgeShift(CHANNELS))
    said = torch.randn(1, 3, CHANNELS, generator=torch.Generator().manual_seed(1))
    seen = [car(time)[: 200 - 40 * time] + VELOCITY * 0.1 * time for time in range(3)]
    gone = torch.randn(1, 3, 3, generator=torch.Generator().manual_seed(2))
    turn = about_z(steps)
    plain, turned = tubes_of(seen), tubes_of(seen, turn)
    with torch.no_grad():
        shift = edges(plain, said, plain.relative, gone)
        other = edges(turned, said, turned.relative, gone @ turn.T)
    assert shift[0, 1:].abs().min() > 1e-3
    torch.testing.assert_close(other, shift @ turn.T, atol=1e-3, rtol=1e-3)


def test_who_is_not_seen_does_not_move() -> None:
    settings = NetworkSettings()
    net = drawn(TubeNet(settings))
    tubes = tubes_of([car(), car()[:0], car() + 1.0])
    features = torch.ones(400, settings.point_channels), torch.ones(400, settings.base_widths[0])
    with torch.no_grad():
        motion = net(tubes, *features).anchor_from_time[-1][0]
    torch.testing.assert_close(motion[:2], torch.eye(4).expand(2, 4, 4))
    assert (motion[2] - torch.eye(4)).abs().max() > 0.1


def test_steady_motion_stays_and_what_jumps_is_drawn_to_it() -> None:
    straight = StraightOn(CHANNELS)
    tubes = tubes_of([car() + VELOCITY * 0.1 * time for time in range(5)])
    steady = -VELOCITY * 0.1 * torch.arange(5)[None, :, None]
    said = torch.zeros(1, 5, CHANNELS)
    with torch.no_grad():
        torch.testing.assert_close(straight(tubes, said, steady), 0.0 * steady)
        jumping = steady.clone()
        jumping[0, 2, 0] += 0.4
        after = jumping + straight(tubes, said, jumping)
    assert (after - steady)[0, 2].norm() < 0.25
    assert (after - steady)[0].norm() < (jumping - steady)[0].norm()


@pytest.mark.parametrize(("cost", "left"), [(-9.0, 0.1), (9.0, 0.9)])
def test_what_the_anchor_alone_has_wrong_is_found_where_it_may_be(cost: float, left: float) -> None:
    straight = StraightOn(CHANNELS)
    tubes = tubes_of([car() + VELOCITY * 0.1 * time for time in range(5)])
    steady = -VELOCITY * 0.1 * torch.arange(5)[None, :, None]
    askew = steady + torch.tensor([0.5, 0.0, 0.0])
    askew[0, 0] = 0.0
    said = torch.zeros(1, 5, CHANNELS)
    with torch.no_grad():
        straight.sure.bias.fill_(cost)
        straight.say.bias[1] = 9.0  # what it finds is believed
        after = askew + straight(tubes, said, askew)
        torch.testing.assert_close(straight(tubes, said, steady), 0.0 * steady, atol=1e-3, rtol=0)
    error = (after - steady)[0, 1:].norm(dim=1).mean() / 0.5
    assert error < left if cost < 0.0 else 0.5 < error < left


def test_there_are_two_kinds() -> None:
    with pytest.raises(SettingsError, match="sides, overlap"):
        replace(NetworkSettings(), tube="corners")
