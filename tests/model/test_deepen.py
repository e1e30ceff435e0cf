"""A network given more levels says what it said before, until it learns."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from lidaraccum.data.frame import Frame
from lidaraccum.model.batch import prepare, to_tensors
from lidaraccum.model.deepen import deepened
from lidaraccum.model.motion import Windows
from lidaraccum.model.network import Network, build_network


def answers(network: Network, frames: list[Frame]) -> tuple[torch.Tensor, ...]:
    with torch.no_grad():
        seen = to_tensors([prepare(frame, network.settings) for frame in frames[:3]])
        features = network.encode(seen)
        said = network.perceive(features, torch.eye(4).repeat(3, 1, 1), Windows.single(3))
        return features.foreground, said.foreground, said.dynamic, said.offset


@pytest.mark.parametrize("added", [1, 2])
def test_more_levels_change_nothing_until_they_learn(
    network: Network, frames: list[Frame], added: int
) -> None:
    own = network.settings
    asked = replace(
        own,
        base_widths=(*own.base_widths, 40, 48)[: 3 + added],
        motion_widths=(*own.motion_widths, 56, 64)[: 2 + added],
        point_channels=16,  # is the weights' own
    )
    grown = deepened(network, asked).eval()
    assert grown.settings == replace(asked, point_channels=own.point_channels)
    again = deepened(network, asked).state_dict()
    assert all(torch.equal(values, again[name]) for name, values in grown.state_dict().items())
    before, after = answers(network, frames), answers(grown, frames)
    assert len(before[1]) > 100
    for old, new in zip(before, after, strict=True):
        torch.testing.assert_close(new, old)


def test_a_tube_net_that_lays_over_begins_as_one_that_asks_sides(network: Network) -> None:
    sides = build_network(replace(network.settings, tube="sides"), seed=7)
    grown = deepened(sides, replace(network.settings, tube="overlap")).state_dict()
    for name, values in sides.state_dict().items():
        assert torch.equal(values, grown[name])
    added = {name for name in grown if name not in sides.state_dict()}
    assert {name.rsplit(".", 3)[0] for name in added} == {"tube_net.overlap.say"}


def test_the_levels_added_learn_from_the_second_step_on(
    network: Network, frames: list[Frame]
) -> None:
    own = network.settings
    grown = deepened(network, replace(own, base_widths=(*own.base_widths, 40)))
    seen = to_tensors([prepare(frame, own) for frame in frames[:1]])
    optimiser = torch.optim.SGD(grown.parameters(), lr=1e-3)
    deepest = grown.backbone.downs[-1].refine.weight
    for reached in (False, True):
        optimiser.zero_grad()
        grown.encode(seen).foreground.square().mean().backward()
        assert bool(deepest.grad.abs().max() > 0) == reached
        optimiser.step()


def test_weights_of_as_many_levels_or_of_others_stay_as_they_are(network: Network) -> None:
    own = network.settings
    assert deepened(network, own) is network
    fewer = replace(own, base_widths=own.base_widths[:2])
    assert deepened(network, fewer) is network
    wider = replace(own, base_widths=(24, 32, 40, 48))
    assert deepened(network, wider) is network
