"""The quick ways give what the plain ones do."""

from __future__ import annotations

import torch
from torch import nn

from lidaraccum.model.unet import to_one_channel


def test_one_channel_is_that_of_the_convolution() -> None:
    layer = nn.Conv2d(5, 1, 3, padding=1)
    maps = torch.rand(2, 5, 7, 9)
    torch.testing.assert_close(to_one_channel(layer, maps), layer(maps)[:, 0])
