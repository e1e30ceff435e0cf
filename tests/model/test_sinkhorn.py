"""Laws of the soft matching."""

from __future__ import annotations

import pytest
import torch

from lidaraccum.model.sinkhorn import sinkhorn as soft_matches


def sinkhorn(affinity: torch.Tensor, rounds: int) -> torch.Tensor:
    return soft_matches(affinity, rounds).dense()


def by_logarithms(affinity: torch.Tensor, rounds: int) -> torch.Tensor:
    """The definition: rows and columns of the slack-padded matrix normalised in log space."""
    padded = torch.nn.functional.pad(affinity, (0, 1, 0, 1))
    for _ in range(rounds):
        rows = padded[:, :-1] - torch.logsumexp(padded[:, :-1], dim=2, keepdim=True)
        padded = torch.cat([rows, padded[:, -1:]], dim=1)
        columns = padded[:, :, :-1] - torch.logsumexp(padded[:, :, :-1], dim=1, keepdim=True)
        padded = torch.cat([columns, padded[:, :, -1:]], dim=2)
    return torch.exp(padded[:, :-1, :-1])


def random_affinity(scale: float) -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    return scale * torch.randn(2, 12, 9, generator=generator).double()


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("rounds", [1, 5])
def test_it_is_the_normalisation_in_log_space(scale: float, rounds: int) -> None:
    affinity = random_affinity(scale)
    torch.testing.assert_close(sinkhorn(affinity, rounds), by_logarithms(affinity, rounds))


def test_rows_and_columns_with_their_slack_sum_to_one() -> None:
    matches = sinkhorn(random_affinity(1.0), 200)
    assert (matches >= 0).all()
    assert (matches.sum(dim=1) <= 1 + 1e-9).all()
    assert (matches.sum(dim=2) <= 1 + 1e-9).all()
    slack_row = 1 - matches.sum(dim=1, keepdim=True)
    slack_column = 1 - matches.sum(dim=2, keepdim=True)
    # At rest, what is matched is kernel times potentials, and the slacks are those potentials.
    torch.testing.assert_close(
        matches, torch.exp(random_affinity(1.0)) * slack_row * slack_column, atol=1e-6, rtol=1e-5
    )


def test_certain_pairs_are_matched_and_impossible_ones_are_not() -> None:
    affinity = torch.full((1, 4, 4), -torch.inf)
    affinity[0].fill_diagonal_(500.0)
    affinity[0, 3] = -torch.inf
    matches = sinkhorn(affinity, 5)[0]
    # Each round takes from the slack what is left to take: 1 - 1 / (rounds + 1).
    torch.testing.assert_close(matches, torch.diag(torch.tensor([5 / 6, 5 / 6, 5 / 6, 0.0])))


def test_the_gradient_is_that_of_differences() -> None:
    affinity = random_affinity(1.0)[:, :5, :4].clone().requires_grad_()
    assert torch.autograd.gradcheck(lambda a: sinkhorn(a, 5), (affinity,))


def test_the_gradient_survives_impossible_pairs() -> None:
    affinity = random_affinity(1.0)
    affinity[:, 0] = -torch.inf
    affinity.requires_grad_()
    sinkhorn(affinity, 5).sum().backward()
    assert affinity.grad is not None
    assert torch.isfinite(affinity.grad).all()


def test_what_is_carried_is_the_sum_over_the_matches() -> None:
    affinity = random_affinity(3.0)
    values = torch.arange(2 * 9 * 4).view(2, 9, 4).double()
    matches = soft_matches(affinity, 5)
    torch.testing.assert_close(matches.carry(values), matches.dense() @ values)
    torch.testing.assert_close(matches.column_mass(), matches.dense().sum(dim=1))
