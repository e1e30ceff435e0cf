"""The ground says how high a frame lies, and how level; partners say what they know."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lidaraccum.geometry import rigid
from lidaraccum.model.kabsch import fit_rigid, invert, move
from lidaraccum.model.levelling import levelled
from lidaraccum.model.partners import drawn_to, spread
from lidaraccum.model.sinkhorn import sinkhorn


def pose(*numbers: float) -> torch.Tensor:
    """(1, 4, 4) of a rotation vector and a shift."""
    return torch.from_numpy(rigid.exponential(np.array(numbers)))[None].float()


TRUTH = pose(0.0, 0.0, 0.03, 1.4, 0.2, 0.04)
WRONG = pose(0.01, -0.015, 0.0, 0.0, 0.0, 0.1)


def ground(seed: int, count: int = 3000) -> torch.Tensor:
    """(count, 3) places of a street that rises gently and has a crown."""
    lot = torch.rand(count, 2, generator=torch.Generator().manual_seed(seed))
    xy = 50.0 * (lot - 0.5)
    height = 0.02 * xy[:, 0] - 0.002 * xy[:, 1] ** 2
    return torch.cat([xy, height[:, None]], dim=1)


def seen(count: int = 3000) -> torch.Tensor:
    """(1, count, 3) the street as the source frame sees it."""
    return move(invert(TRUTH), ground(2, count)[None])


def error_m(motion: torch.Tensor) -> float:
    return float((move(motion, seen()) - move(TRUTH, seen())).norm(dim=2).mean())


def test_height_and_tilt_come_from_the_ground() -> None:
    target, source = ground(1)[None], seen()
    every = torch.ones(1, 3000, dtype=torch.bool)
    begun = WRONG @ TRUTH
    motion = levelled(begun, source, every, target, every)
    assert error_m(begun) > 0.1
    assert error_m(motion) < 0.02
    # The way, and the heading, are not its business.
    moved = (motion @ invert(begun))[0]
    assert moved[1, 0].abs() < 1e-3
    assert moved[:2, 3].norm() < 1e-3


def test_what_is_no_ground_does_not_lift_it() -> None:
    """A tenth of the places are kerbs and cars; some are not there at all."""
    target, source = ground(1)[None], seen()
    target[:, ::10, 2] += 1.5
    target[:, 5::10, 2] += 0.3
    every = torch.ones(1, 3000, dtype=torch.bool)
    known = every.clone()
    known[:, 2000:] = False
    target[:, 2000:] = 0.0
    assert error_m(levelled(WRONG @ TRUTH, source, every, target, known)) < 0.03


@pytest.mark.parametrize("count", [0, 40])
def test_too_little_ground_says_nothing(count: int) -> None:
    every = torch.ones(1, count, dtype=torch.bool)
    begun = WRONG @ TRUTH
    motion = levelled(begun, seen(count), every, ground(2, count)[None], every)
    assert torch.equal(motion, begun)


def wall(seed: int) -> torch.Tensor:
    """(400, 3): two walls along x, and one corner of a third."""
    lot = torch.rand(400, 3, generator=torch.Generator().manual_seed(seed))
    places = lot * torch.tensor([40.0, 0.0, 2.0]) + torch.tensor([-20.0, 6.0, 0.0])
    places[200:, 1] = -6.0
    places[360:, 0] = 15.0
    places[360:, 1] = 6.0 + 6.0 * lot[360:, 1]
    return places


def test_partners_lie_along_the_walls_they_are_of() -> None:
    target, source = wall(0)[None], wall(1)[None]
    apart = torch.cdist(source, target)
    near = (-2.0 * (apart / 1.5) ** 2).masked_fill(apart > 1.5, -torch.inf) + 3.0
    matches = sinkhorn(near, 3)
    covariance = spread(matches, target, matches.dense().sum(dim=2))[0]
    along, across = covariance[:200, 0, 0], covariance[:200, 1, 1]
    assert along.median() > 20.0 * across.median()
    index = 50
    weight = matches.dense()[0, index]
    by_hand = np.cov(target[0].numpy().T, aweights=weight.numpy(), ddof=0)
    np.testing.assert_allclose(covariance[index].numpy(), by_hand, atol=1e-4)


def test_a_partner_says_nothing_of_the_way_along_its_wall() -> None:
    """All along the walls are 20 cm too far on; the few at the corner know better."""
    source = wall(1)[None]
    partner = source.clone()
    partner[:, :360, 0] += 0.2
    sure, unsure = 1e-4, 0.3**2
    covariance = torch.diag_embed(torch.tensor([unsure, sure, sure])).repeat(1, 400, 1, 1)
    covariance[:, 360:] = torch.diag_embed(torch.tensor([sure, unsure, sure]))
    mass = torch.ones(1, 400)
    begun = pose(0.0, 0.0, 0.004, 0.0, 0.12, 0.0)
    drawn = drawn_to(begun, source, partner, covariance, mass)
    even = fit_rigid(source, partner, mass)
    by_way = [(move(one, source) - source)[0].abs().mean(dim=0) for one in (drawn, even)]
    assert by_way[0].max() < 0.11
    assert by_way[1][0] > 0.17


def test_no_partner_no_step() -> None:
    source = wall(1)[None]
    nothing = torch.zeros(1, 400)
    motion = drawn_to(TRUTH, source, source, torch.zeros(1, 400, 3, 3), nothing)
    torch.testing.assert_close(motion, TRUTH)
