"""Convolutions that learn as fast as they are applied, on processors of any width."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import torch
from torch import nn

from lidaraccum.model.precision import has_wide_units

CELLS = 512
"""Cells whose neighbourhoods are laid out at a time: they should fit the processor's cache."""


class Convolution(nn.Conv2d):
    """A `torch.nn.Conv2d` of square kernels, the same numbers in and out.

    The libraries beneath torch know no fast way to the gradient of a kernel on processors without
    512-bit vectors: it takes five times as long as the convolution does. There it is worked out as
    products of matrices.
    """

    def forward(self, input: torch.Tensor) -> torch.Tensor:
        """Maps (N, O, H', W') of maps (N, I, H, W)."""
        learns = torch.is_grad_enabled() and self.weight.requires_grad
        plain = input.device.type == "cpu" and input.dtype == torch.float32
        if not learns or not plain or torch.is_autocast_enabled("cpu") or has_wide_units():
            return super().forward(input)
        geometry = (self.stride[0], int(self.padding[0]))
        given = (input, self.weight, self.bias, geometry)
        answer: torch.Tensor = _ByProducts.apply(*given)  # type: ignore[no-untyped-call]
        return answer


class _ByProducts(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        maps: torch.Tensor,
        weight: torch.Tensor,
        bias: torch.Tensor | None,
        geometry: tuple[int, int],
    ) -> torch.Tensor:
        ctx.save_for_backward(maps, weight)
        ctx.geometry = geometry
        stride, padding = geometry
        return nn.functional.conv2d(maps, weight, bias, stride, padding)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
        maps, weight = ctx.saved_tensors
        stride, padding = ctx.geometry
        (gradient,) = gradients
        for_maps = for_weight = for_bias = None
        if ctx.needs_input_grad[0]:
            for_maps = torch.ops.aten.convolution_backward(
                gradient, maps, weight, None, [stride] * 2, [padding] * 2, [1, 1],
                False, [0, 0], 1, [True, False, False],
            )[0]  # fmt: skip
        if ctx.needs_input_grad[1]:
            for_weight = weight_gradient(maps, gradient, weight.shape[2], stride, padding)
        if ctx.needs_input_grad[2]:
            for_bias = gradient.sum(dim=(0, 2, 3))
        return for_maps, for_weight, for_bias, None


def weight_gradient(
    maps: torch.Tensor, gradient: torch.Tensor, side: int, stride: int, padding: int
) -> torch.Tensor:
    """Gradient (O, I, K, K) of a kernel.

    Args:
        maps: (N, I, H, W) that were convolved.
        gradient: (N, O, H', W') of what came out.
        side: K.
        stride: The convolution's.
        padding: The convolution's, in zeros.
    """
    edge = (0, 0, padding, padding, padding, padding)
    cells = nn.functional.pad(maps.permute(0, 2, 3, 1), edge).contiguous()
    gradient = gradient.permute(0, 2, 3, 1)
    count, height, width, outputs = gradient.shape
    image, row, column, _ = cells.stride()
    shape = (count, height, width, side, side, cells.shape[3])
    around = cells.as_strided(shape, (image, row * stride, column * stride, row, column, 1))
    total = maps.new_zeros(outputs, side * side * cells.shape[3])
    for images in _parts(count, CELLS // (height * width)):
        for rows in _parts(height, CELLS // width):
            wanted = gradient[images, rows].reshape(-1, outputs)
            total.addmm_(wanted.T, around[images, rows].reshape(len(wanted), -1))
    return total.view(outputs, side, side, -1).permute(0, 3, 1, 2)


def _parts(count: int, size: int) -> Iterator[slice]:
    size = max(1, size)
    return (slice(first, first + size) for first in range(0, count, size))
