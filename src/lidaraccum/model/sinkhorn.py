"""Entropy-regularised matching with a slack row and column."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch

LARGEST_AFFINITY = 40.0
"""Beyond this a pair is certain, and its exponential must stay within float32."""


@dataclass(frozen=True, eq=False)
class SoftMatches:
    """Soft matches (B, N, M), 0..1, kept as the product of a kernel and two potentials.

    Rows and columns of the matrix, each with its slack entry, sum to at most 1. What a row lacks
    to 1 went to its slack: an outlier.

    Attributes:
        kernel: (B, N, M): exponentials of the affinities.
        row: (B, N) potential.
        column: (B, M) potential.
    """

    kernel: torch.Tensor
    row: torch.Tensor
    column: torch.Tensor

    def carry(self, values: torch.Tensor) -> torch.Tensor:
        """What rows (B, N, C) get of the columns' values (B, M, C): the sum over their matches."""
        return self.row[..., None] * (self.kernel @ (self.column[..., None] * values))

    def column_mass(self) -> torch.Tensor:
        """How far each column is matched: (B, M), 0..1."""
        return self.column * (self.row[:, None] @ self.kernel)[:, 0]

    def double(self) -> SoftMatches:
        """The same in float64."""
        return SoftMatches(self.kernel.double(), self.row.double(), self.column.double())

    def dense(self) -> torch.Tensor:
        """All matches (B, N, M)."""
        return self.kernel * self.row[..., None] * self.column[:, None]


def sinkhorn(affinity: torch.Tensor, rounds: int) -> SoftMatches:
    """Soft matches of affinities (B, N, M) against a slack of affinity 0.

    Rows and columns of the matrix, each with its slack entry, are normalised in turn; the slack
    row and column themselves are not.

    Kept as potentials of one fixed kernel, so a round costs two matrix-vector products instead of
    two log-sum-exps over the whole matrix. The slack of 1 in every sum makes that as safe as
    working on logarithms throughout: no sum falls below 1, and the affinity is bounded above.

    Args:
        affinity: (B, N, M) float32; -inf for pairs that cannot be.
        rounds: Row and column normalisations.

    Source: Sinkhorn; Cuturi (2013); slack as in RPM-Net (Yew and Lee, 2020).
    """
    kernel = torch.exp(affinity.clamp_max(LARGEST_AFFINITY))
    row, column = _Balance.apply(kernel, rounds)  # type: ignore[no-untyped-call]
    return SoftMatches(kernel, row, column)


class _Balance(torch.autograd.Function):
    """The potentials of a kernel after some rounds.

    The derivative of each product of the kernel with a vector is a matrix of rank 1. Summed one by
    one, as automatic differentiation does, these matrices cost several times what the rounds cost;
    here they are summed in one product of two thin matrices.
    """

    @staticmethod
    def forward(ctx: Any, kernel: torch.Tensor, rounds: int) -> tuple[torch.Tensor, torch.Tensor]:
        turned = kernel.transpose(1, 2)
        column = kernel.new_ones(kernel.shape[0], kernel.shape[2])
        rows, columns = [], [column]
        for _ in range(rounds):
            row = 1.0 / (_times(kernel, column) + 1.0)
            column = 1.0 / (_times(turned, row) + 1.0)
            rows.append(row)
            columns.append(column)
        ctx.save_for_backward(kernel, *rows, *columns)
        ctx.rounds = rounds
        return rows[-1], column

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, None]:
        kernel, *saved = ctx.saved_tensors
        rows, columns = saved[: ctx.rounds], saved[ctx.rounds :]
        turned = kernel.transpose(1, 2)
        of_row, of_column = gradients
        left, right = [], []
        for number in reversed(range(ctx.rounds)):
            row, column = rows[number], columns[number + 1]
            of_sum = -of_column * column**2  # of the column's sum over the kernel
            left.append(row)
            right.append(of_sum)
            of_row = of_row + _times(kernel, of_sum)
            of_sum = -of_row * row**2
            left.append(of_sum)
            right.append(columns[number])
            of_column = _times(turned, of_sum)
            of_row = torch.zeros_like(of_row)
        return torch.stack(left, dim=2) @ torch.stack(right, dim=1), None


def _times(matrix: torch.Tensor, vector: torch.Tensor) -> torch.Tensor:
    """(B, N) of (B, N, M) and (B, M)."""
    return (matrix @ vector[..., None])[..., 0]
