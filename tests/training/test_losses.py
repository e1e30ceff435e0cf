"""Laws of the losses."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch

from lidaraccum.training.losses import (
    lovasz,
    offset_loss,
    segmentation_loss,
    weighted_cross_entropy,
)


def jaccard_loss(wrong: tuple[int, ...], truth: np.ndarray) -> float:
    """1 - IoU of the positive class when exactly the points ``wrong`` are misjudged."""
    said = truth.copy()
    for index in wrong:
        said[index] = not said[index]
    union = np.count_nonzero(said | truth)
    return 1.0 - np.count_nonzero(said & truth) / union if union else 0.0


def lovasz_by_definition(errors: np.ndarray, truth: np.ndarray) -> float:
    """The extension as the integral over thresholds of the loss of the set above each."""
    levels = np.unique(np.concatenate([[0.0], errors]))
    total = 0.0
    for low, high in itertools.pairwise(levels):
        wrong = tuple(np.flatnonzero(errors > low).tolist())
        total += (high - low) * jaccard_loss(wrong, truth)
    return total


@pytest.mark.parametrize("seed", range(20))
def test_lovasz_is_the_extension_of_the_jaccard_loss(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 9))
    errors, truth = rng.random(count), rng.random(count) < 0.5
    truth[0] = True
    got = lovasz(torch.from_numpy(errors), torch.from_numpy(truth))
    assert float(got) == pytest.approx(lovasz_by_definition(errors, truth), abs=1e-6)


@pytest.mark.parametrize("pattern", list(itertools.product([False, True], repeat=4)))
def test_lovasz_of_hard_answers_is_the_jaccard_loss(pattern: tuple[bool, ...]) -> None:
    truth = np.array([True, True, False, False])
    wrong = np.array(pattern)
    got = lovasz(torch.from_numpy(wrong.astype(np.float32)), torch.from_numpy(truth))
    expected = jaccard_loss(tuple(np.flatnonzero(wrong).tolist()), truth)
    assert float(got) == pytest.approx(expected, abs=1e-6)


def test_lovasz_says_nothing_of_a_class_that_is_not_there() -> None:
    assert float(lovasz(torch.rand(5), torch.zeros(5, dtype=torch.bool))) == 0.0


def test_cross_entropy_weighs_classes_by_the_root_of_their_rarity() -> None:
    truth = torch.tensor([True] + [False] * 8)
    loss = weighted_cross_entropy(torch.zeros(9), truth)
    expected = np.log(2) * (np.sqrt(9 / 1) * 1 + np.sqrt(9 / 8) * 8) / 9
    assert float(loss) == pytest.approx(expected, rel=1e-6)


def test_cross_entropy_weights_are_bounded() -> None:
    truth = torch.zeros(10_000, dtype=torch.bool)
    truth[0] = True
    logits = torch.full((10_000,), -50.0)
    logits[0] = 0.0
    assert float(weighted_cross_entropy(logits, truth)) == pytest.approx(50 * np.log(2) / 10_000)


@pytest.mark.parametrize("truth", [[False, False], [True, True], [True, False], []])
def test_segmentation_loss_has_a_finite_gradient(truth: list[bool]) -> None:
    logits = torch.zeros(len(truth), requires_grad=True)
    segmentation_loss(logits, torch.tensor(truth, dtype=torch.bool)).backward()
    assert logits.grad is not None
    assert torch.isfinite(logits.grad).all()


def test_offset_loss_is_nothing_for_the_truth_and_two_for_the_opposite_direction() -> None:
    truth = torch.tensor([[3.0, 4.0]])
    assert float(offset_loss(truth, truth)) == pytest.approx(0.0, abs=1e-6)
    assert float(offset_loss(-truth, truth)) == pytest.approx(14.0 + 2.0, abs=1e-5)


def test_an_offset_of_nothing_has_no_direction() -> None:
    assert float(offset_loss(torch.tensor([[0.2, 0.0]]), torch.zeros(1, 2))) == pytest.approx(0.2)
