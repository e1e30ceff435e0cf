"""Several processes learn what one would."""

from __future__ import annotations

from types import ModuleType

import pytest
import torch

from lidaraccum.model.network import Network, build_network
from lidaraccum.training.crew import Crew
from lidaraccum.training.objective import LOSS_NAMES, ObjectiveSettings

CALM = ObjectiveSettings(poses="true")


def gradient_of(network: Network) -> torch.Tensor:
    parts = [torch.zeros_like(p) if p.grad is None else p.grad for p in network.parameters()]
    return torch.cat([part.reshape(-1) for part in parts])


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 3])
def test_two_processes_give_the_mean_of_their_shares(toy: ModuleType, count: int) -> None:
    windows = [toy.CarParks().windows(number)[0] for number in range(count)]
    network = build_network(toy.SMALL)
    losses = Crew(network, CALM, 2).learn(windows, 7)
    found = gradient_of(network)
    wanted, numbers = torch.zeros_like(found), torch.zeros(len(LOSS_NAMES))
    for place, share in enumerate((windows[0::2], windows[1::2])):
        if share:
            alone = build_network(toy.SMALL)
            said = Crew(alone, CALM, 1).learn(share, 7 + place * (1 << 40))
            wanted += gradient_of(alone) * len(share) / count
            numbers += torch.tensor(said) * len(share) / count
    assert wanted.abs().max() > 0.01
    torch.testing.assert_close(found, wanted, rtol=1e-3, atol=1e-3 * float(wanted.abs().max()))
    torch.testing.assert_close(torch.tensor(losses), numbers, rtol=1e-3, atol=1e-5)


@pytest.mark.slow
def test_the_others_see_each_step(toy: ModuleType) -> None:
    windows = [toy.CarParks().windows(number)[0] for number in range(2)]
    network = build_network(toy.SMALL)
    crew = Crew(network, CALM, 2)
    before = crew.learn(windows, 1)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.mul_(0.5)
    after = crew.learn(windows, 1)
    single = Crew(network, CALM, 1)
    expected = [single.learn(windows[place:], 1 + place * (1 << 40))[0] for place in (1,)]
    theirs = 2 * after[0] - single.learn(windows[:1], 1)[0]
    assert theirs == pytest.approx(expected[0], rel=1e-3)
    assert abs(after[0] - before[0]) > 1e-3
