"""Several processes learn what one would."""

from __future__ import annotations

from types import ModuleType

import pytest
import torch

from lidaraccum.model.network import Network, build_network
from lidaraccum.training.crew import Crew
from lidaraccum.training.objective import ObjectiveSettings
from lidaraccum.training.window import TrainingWindow

CALM = ObjectiveSettings(poses="true")


def gradient_of(network: Network) -> torch.Tensor:
    parts = [torch.zeros_like(p) if p.grad is None else p.grad for p in network.parameters()]
    return torch.cat([part.reshape(-1) for part in parts])


def mean_of_shares(
    toy: ModuleType, windows: list[TrainingWindow]
) -> tuple[torch.Tensor, torch.Tensor]:
    """Gradient and losses of two shares, each learned by a process of its own, averaged."""
    gradients, losses = [], []
    for place, share in enumerate((windows[0::2], windows[1::2])):
        if share:
            alone = build_network(toy.SMALL)
            said = Crew(alone, CALM, 1).learn(share, 7 + place * (1 << 40))
            gradients.append(gradient_of(alone) * len(share) / len(windows))
            losses.append(torch.tensor(said) * len(share) / len(windows))
    return torch.stack(gradients).sum(dim=0), torch.stack(losses).sum(dim=0)


@pytest.mark.slow
def test_two_processes_give_the_mean_of_their_shares(toy: ModuleType) -> None:
    network = build_network(toy.SMALL)
    crew = Crew(network, CALM, 2)
    for count in (1, 2, 3):
        windows = [toy.CarParks().windows(number)[0] for number in range(count)]
        losses = torch.tensor(crew.learn(windows, 7))
        wanted, numbers = mean_of_shares(toy, windows)
        bound = 1e-3 * float(wanted.abs().max())
        assert bound > 1e-5
        torch.testing.assert_close(gradient_of(network), wanted, rtol=1e-3, atol=bound)
        torch.testing.assert_close(losses, numbers, rtol=1e-3, atol=1e-5)


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
