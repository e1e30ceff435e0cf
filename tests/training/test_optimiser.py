"""Adam and Muon behind one interface: what is moved, how far, and what is remembered."""

from __future__ import annotations

import copy
from types import ModuleType

import pytest
import torch

from lidaraccum.model.network import Network, build_network
from lidaraccum.training import optimiser
from lidaraccum.training.optimiser import Optimiser


def network(toy: ModuleType) -> Network:
    return build_network(toy.SMALL, 0)


def give_gradients(network: torch.nn.Module, seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    for weight in network.parameters():
        weight.grad = torch.randn(weight.shape, generator=generator)


def test_adam_alone_is_torchs_adam(toy: ModuleType) -> None:
    mine, its = network(toy), network(toy)
    learning = Optimiser(mine, 1e-3)
    reference = torch.optim.Adam(its.parameters(), lr=3e-3)
    for seed in range(3):
        for one in (mine, its):
            give_gradients(one, seed)
        learning.step(3e-3)
        reference.step()
    for one, other in zip(mine.parameters(), its.parameters(), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=0)


@pytest.mark.parametrize("shared", [False, True])
def test_muon_moves_a_layer_as_far_in_every_direction(toy: ModuleType, shared: bool) -> None:
    """Also where the weights are moved to memory that processes share."""
    learner = network(toy)
    learning = Optimiser(learner, 1e-3, muon=True)
    if shared:
        learner.share_memory()
    before = copy.deepcopy(learner)
    give_gradients(learner, 0)
    learning.step(1e-3)
    moved = 0
    pairs = zip(learner.parameters(), before.parameters(), strict=True)
    for now, then in pairs:
        way = (now - then).detach()
        assert way.abs().max() > 0, "nothing is left out"
        if way.ndim >= 2 and min(len(way), way[0].numel()) >= 16:
            spread = torch.linalg.svdvals(way.flatten(1))
            assert spread.max() < 3 * spread.min()
            assert way.square().mean().sqrt() == pytest.approx(2e-4, rel=0.25), "as Adam's"
            moved += 1
        else:
            assert way.abs() == pytest.approx(1e-3, rel=0.01), "Adam's first step"
    assert moved > 10


@pytest.mark.parametrize("bfloat16", [False, True])
def test_muon_goes_where_torchs_does(
    toy: ModuleType, bfloat16: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which multiplies in bfloat16: they differ by what that rounds."""
    monkeypatch.setattr(optimiser, "has_bfloat16", lambda device: bfloat16)
    mine, its = network(toy), network(toy)
    before = copy.deepcopy(mine)
    layers = [one for one in its.parameters() if one.ndim == 2 and min(one.shape) >= 16]
    reference = torch.optim.Muon(layers, lr=1e-3, weight_decay=0.0, adjust_lr_fn="match_rms_adamw")
    learner = Optimiser(mine, 1e-3, muon=True)
    for seed in range(3):
        for one in (mine, its):
            give_gradients(one, seed)
        learner.step(1e-3)
        reference.step()
    compared = 0
    for one, other, old in zip(
        mine.parameters(), its.parameters(), before.parameters(), strict=True
    ):
        if any(other is layer for layer in layers):
            ways = [(end - old).detach() for end in (one, other)]
            assert (ways[0] - ways[1]).norm() < 0.03 * ways[1].norm()
            compared += 1
    assert compared > 3


@pytest.mark.parametrize("muon", [False, True])
def test_what_it_remembers_goes_on_as_if_it_had_not_stopped(toy: ModuleType, muon: bool) -> None:
    through = network(toy)
    first = Optimiser(through, 1e-3, muon=muon)
    for seed in range(2):
        give_gradients(through, seed)
        first.step(1e-3)
    resumed = copy.deepcopy(through)
    second = Optimiser(resumed, 1e-3, muon=muon)
    second.recall(first.memory(), 2)
    for learning, one in ((first, through), (second, resumed)):
        give_gradients(one, 2)
        learning.step(5e-4)
    for one, other in zip(through.parameters(), resumed.parameters(), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=1e-7)
