"""Convolutions in whole bytes, for processors that multiply bytes several times faster."""

from __future__ import annotations

from typing import cast

import torch
from torch import nn

from lidaraccum.model.network import Network
from lidaraccum.model.precision import has_bfloat16, has_byte_units

LEVELS = 254
"""Steps between least and most: one less than a byte has, lest what is rounded up wraps round."""

_LIKE_FLOATS = 0.05
"""A convolution in bytes that is off by more than this share of what it should be is not used."""


class ByteConvolution(nn.Module):
    """What a convolution does, its inputs and weights rounded to bytes; in and out in float32.

    Each output channel's weights have a scale of their own; inputs have one, that of what comes
    in, so that no frame is cut off by what others were like.

    Args:
        layer: Whose weights.
    """

    def __init__(self, layer: nn.Conv2d) -> None:
        super().__init__()
        self._geometry = (list(layer.stride), cast("list[int]", list(layer.padding)), [1, 1], 1)
        self._bias = layer.bias
        weight = layer.weight.detach()
        self._scales = weight.abs().amax(dim=(1, 2, 3)).clamp_min(1e-12) / (LEVELS // 2)
        whole = (weight / self._scales[:, None, None, None]).round().to(torch.int8)
        self._zeros = torch.zeros(len(whole), dtype=torch.int32)
        self._weight = torch.ops.onednn.qconv_prepack(
            whole, self._scales, 1.0, 0, *self._geometry, None
        )

    def forward(self, maps: torch.Tensor) -> torch.Tensor:
        """Maps (N, C', H', W') float32 of maps (N, C, H, W), channels last in memory."""
        low, high = (float(end) for end in torch.aminmax(maps.permute(0, 2, 3, 1)))
        scale = max(max(high, 0.0) - min(low, 0.0), 1e-12) / LEVELS
        zero = round(-min(low, 0.0) / scale)
        whole = torch.add(maps.new_tensor(zero + 0.5), maps, alpha=1.0 / scale).to(torch.uint8)
        answer: torch.Tensor = torch.ops.onednn.qconv2d_pointwise(
            whole, scale, zero, self._weight, self._scales, self._zeros, self._bias,
            *self._geometry, 1.0, 0, torch.float32, "none", [], "",
        )  # fmt: skip
        return answer


def in_bytes(network: Network) -> Network:
    """The network with its 3 x 3 convolutions in bytes, where that is fast: to answer only.

    It is changed in place, and left as it is where the processor or PyTorch knows no such way.
    """
    if has_bfloat16("cpu") or not has_byte_units() or not is_sound():
        return network
    for module in list(network.modules()):
        for name, layer in list(module.named_children()):
            if _is_large(layer):
                setattr(module, name, ByteConvolution(cast("nn.Conv2d", layer)))
    return network


def _is_large(layer: nn.Module) -> bool:
    return isinstance(layer, nn.Conv2d) and layer.kernel_size == (3, 3) and layer.out_channels > 1


def is_sound() -> bool:
    """Whether this PyTorch has the operators, and they do what they are to do."""
    with torch.random.fork_rng(devices=[]), torch.inference_mode():
        torch.manual_seed(0)
        layer = nn.Conv2d(16, 16, 3, padding=1)
        maps = torch.randn(1, 16, 12, 12).contiguous(memory_format=torch.channels_last)
        try:
            answer = ByteConvolution(layer)(maps)
        except (AttributeError, NotImplementedError, RuntimeError, TypeError):
            return False
        wanted = layer(maps)
        return bool((answer - wanted).norm() < _LIKE_FLOATS * wanted.norm())
