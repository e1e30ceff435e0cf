"""The maximum over groups of rows, with a derivative that costs no more than the maximum."""

from __future__ import annotations

from typing import Any

import torch


def tallest(values: torch.Tensor, slot: torch.Tensor, count: int) -> torch.Tensor:
    """Maximum (count, C) over 0 and the values (Q, C) of each slot: a ReLU is in it.

    Args:
        values: (Q, C).
        slot: (Q,) int64, 0..count-1.
        count: Number of slots.
    """
    pooled: torch.Tensor = _Tallest.apply(values, slot, count)  # type: ignore[no-untyped-call]
    return pooled


class _Tallest(torch.autograd.Function):
    """Each of several equally tall values gets the whole gradient.

    Sharing it out, as automatic differentiation does, means counting them: five times the work.
    Ties matter only at 0, and there no value is one by chance.
    """

    @staticmethod
    def forward(ctx: Any, values: torch.Tensor, slot: torch.Tensor, count: int) -> torch.Tensor:
        start = values.new_zeros(count, values.shape[1])
        pooled = start.scatter_reduce(0, slot[:, None].expand_as(values), values, "amax")
        ctx.save_for_backward(values, slot, pooled)
        return pooled

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, None, None]:
        values, slot, pooled = ctx.saved_tensors
        is_tallest = values == pooled.index_select(0, slot)
        return gradients[0].index_select(0, slot) * is_tallest, None, None
