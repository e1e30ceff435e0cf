"""Parts added to a trained network, which answers as before until they have learned.

Source: Net2Net (Chen et al., ICLR 2016): a deeper network that begins as the same function.
"""

from __future__ import annotations

from dataclasses import replace

import torch

from lidaraccum.model.network import Network, build_network
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.unet import channels_last


def deepened(network: Network, settings: NetworkSettings) -> Network:
    """A network with as many levels as the settings ask for, which says what this one says.

    A TubeNet of another kind begins as the trained one, but for what that did not ask.

    Args:
        network: Trained. It is returned as it is where the settings ask for no more levels, or for
            others, and for its own kind of TubeNet.
        settings: Whose ``base_widths`` and ``motion_widths`` to reach, where they begin with the
            network's own, and whose ``tube``. What is new begins alike, whoever asks: runs that
            go on from the same weights may be averaged.
    """
    own = network.settings
    deeper = replace(
        own,
        base_widths=_longer(own.base_widths, settings.base_widths),
        motion_widths=_longer(own.motion_widths, settings.motion_widths),
        tube=settings.tube,
    )
    if deeper == own:
        return network
    grown = build_network(deeper)
    with torch.no_grad():
        grown.backbone.go_on_from(network.backbone)
        grown.motion_map.unet.go_on_from(network.motion_map.unet)
        rest = {
            name: values
            for name, values in network.state_dict().items()
            if not name.startswith(("backbone.", "motion_map.unet."))
        }
        grown.load_state_dict(rest, strict=False)
    channels_last(grown)
    return grown


def _longer(own: tuple[int, ...], asked: tuple[int, ...]) -> tuple[int, ...]:
    return asked if asked[: len(own)] == own else own
