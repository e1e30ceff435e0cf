"""A small network and the shared drive as it sees it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import torch

from lidaraccum.data.frame import Frame
from lidaraccum.model.network import Network, build_network
from lidaraccum.model.settings import NetworkSettings


@pytest.fixture(scope="session")
def settings() -> NetworkSettings:
    return NetworkSettings(
        extent_m=32.0,
        base_widths=(16, 24, 32),
        motion_widths=(32, 48),
        ego_pillars=256,
        temporal_channels=16,
        temporal_blocks=1,
        point_channels=48,
        tube_channels=48,
    )


@pytest.fixture(scope="session")
def network(settings: NetworkSettings) -> Network:
    """Fresh weights that see foreground, so that there is something to read out."""
    network = build_network(settings, seed=1).eval()
    with torch.no_grad():
        network.foreground_head[2].bias.fill_(-0.9)
    return network.requires_grad_(False)


@pytest.fixture(scope="session")
def frames(drive: Any) -> list[Frame]:
    return [Frame(points, stamp=0.1 * index) for index, points in enumerate(drive.frames)]


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
