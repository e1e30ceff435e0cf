"""Entropy-regularised matching with a slack row and column."""

from __future__ import annotations

import torch

LARGEST_AFFINITY = 40.0
"""Beyond this a pair is certain, and its exponential must stay within float32."""


def sinkhorn(affinity: torch.Tensor, rounds: int) -> torch.Tensor:
    """Soft matches (B, N, M), 0..1, of affinities (B, N, M) against a slack of affinity 0.

    Rows and columns of the matrix, each with its slack entry, are normalised in turn; the slack
    row and column themselves are not. What a row lacks to 1 went to its slack: an outlier.

    Kept as potentials of one fixed kernel, so a round costs two matrix-vector products instead of
    two log-sum-exps over the whole matrix. The slack of 1 in every sum makes that as safe as
    working on logarithms throughout: no sum falls below 1, and the affinity is bounded above.

    Args:
        affinity: (B, N, M) float32; -inf for pairs that cannot be.
        rounds: Row and column normalisations.

    Source: Sinkhorn; Cuturi (2013); slack as in RPM-Net (Yew and Lee, 2020).
    """
    kernel = torch.exp(affinity.clamp_max(LARGEST_AFFINITY))
    row = kernel.new_ones(kernel.shape[0], kernel.shape[1], 1)
    column = kernel.new_ones(kernel.shape[0], kernel.shape[2], 1)
    for _ in range(rounds):
        row = 1.0 / (kernel @ column + 1.0)
        column = 1.0 / (kernel.transpose(1, 2) @ row + 1.0)
    return kernel * row * column.transpose(1, 2)
