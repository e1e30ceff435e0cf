"""Convolutions in bytes say nearly what those in float32 do, whatever comes in."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from lidaraccum.model.bytes import ByteConvolution, in_bytes, is_sound
from lidaraccum.model.network import build_network
from lidaraccum.model.precision import has_byte_units

pytestmark = pytest.mark.skipif(
    not (has_byte_units() and is_sound()), reason="no convolutions in bytes on this machine"
)


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize(("least", "most"), [(0.0, 1.0), (-3.0, 0.5), (2.0, 40.0), (-5.0, -1.0)])
def test_any_range_of_inputs_is_answered(stride: int, least: float, most: float) -> None:
    torch.manual_seed(0)
    layer = nn.Conv2d(24, 40, 3, stride=stride, padding=1).requires_grad_(False)
    maps = torch.empty(1, 24, 20, 16).uniform_(least, most)
    maps = maps.contiguous(memory_format=torch.channels_last)
    wanted, answer = layer(maps), ByteConvolution(layer)(maps)
    assert (answer - wanted).norm() < 0.02 * wanted.norm()


def test_empty_maps_give_the_bias() -> None:
    layer = nn.Conv2d(16, 16, 3, padding=1).requires_grad_(False)
    answer = ByteConvolution(layer)(torch.zeros(1, 16, 8, 8))
    torch.testing.assert_close(answer, layer(torch.zeros(1, 16, 8, 8)))


def test_a_network_in_bytes_keeps_its_small_layers() -> None:
    network = in_bytes(build_network())
    assert isinstance(network.foreground_head[-1], nn.Conv2d)
    assert isinstance(network.motion_map.halve, nn.Conv2d)
