"""Pillars matched again and again."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from lidaraccum.model.ego_motion import EgoPillars, Matcher
from lidaraccum.model.kabsch import move
from lidaraccum.model.settings import NetworkSettings

TURN = torch.tensor(0.02)
TRUTH = torch.tensor(
    [
        [TURN.cos(), -TURN.sin(), 0.0, 0.8],
        [TURN.sin(), TURN.cos(), 0.0, -0.3],
        [0.0, 0.0, 1.0, 0.02],
        [0.0, 0.0, 0.0, 1.0],
    ]
)


def pillars(position: torch.Tensor, feature: torch.Tensor) -> EgoPillars:
    """Of one frame, which saw no ground."""
    every = torch.ones(1, len(position)).bool()
    ground = position[None, :0]
    return EgoPillars(
        position[None], feature[None], every, ground, every[:, :0], torch.eye(4)[None]
    )


@pytest.fixture
def pair() -> tuple[EgoPillars, EgoPillars]:
    """Two draws of one street's pillars, each with a tenth of them, whose features tell little."""
    rng = torch.Generator().manual_seed(0)
    places = 30.0 * (2.0 * torch.rand(6000, 3, generator=rng) - 1.0) * torch.tensor([1, 1, 0.05])
    kinds = torch.nn.functional.normalize(torch.randn(6000, 8, generator=rng), dim=1)
    one, other = (torch.randperm(6000, generator=rng)[:600] for _ in range(2))
    moved = move(TRUTH, places[other])
    return pillars(places[one], kinds[one]), pillars(moved, kinds[other])


def error_m(matcher: Matcher, pair: tuple[EgoPillars, EgoPillars]) -> float:
    source, target = pair
    with torch.no_grad():
        match = matcher(source, target, torch.tensor([0.1]))
    told, true = (move(pose, source.position[0]) for pose in (match.target_from_source[0], TRUTH))
    return float((told - true).norm(dim=1).mean())


def test_what_is_matched_more_finely_is_placed_better(pair: tuple[EgoPillars, EgoPillars]) -> None:
    settings = NetworkSettings()
    finer = error_m(Matcher(settings).eval(), pair)
    as_learned = error_m(Matcher(replace(settings, finer_m=())).eval(), pair)
    assert finer < 0.7 * as_learned


def test_training_knows_only_rounds_that_are_learned(pair: tuple[EgoPillars, EgoPillars]) -> None:
    matcher = Matcher(NetworkSettings()).train()
    match = matcher(*pair, torch.tensor([0.1]))
    assert match.rounds.shape[1] == 1 + len(matcher.rematch_m) == len(matcher.offset)
