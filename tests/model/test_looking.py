"""Which points of a window are looked at closely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from lidaraccum.data.frame import Frame
from lidaraccum.model.batch import prepare, to_tensors
from lidaraccum.model.looking import FOREGROUND_GATE, close_pillars, points_of
from lidaraccum.model.motion import Windows
from lidaraccum.model.network import FrameFeatures, Network, build_network
from lidaraccum.model.settings import NetworkSettings

SETTINGS = NetworkSettings(
    extent_m=16.0, base_widths=(16, 24, 32), motion_widths=(32, 48), ego_pillars=64,
    temporal_channels=16, temporal_blocks=1, point_channels=48, tube_channels=48,
)  # fmt: skip
WINDOW = Windows.single(2)


def _network(glance_odds: float) -> Network:
    return build_network(replace(SETTINGS, glance_odds=glance_odds)).eval()


@pytest.fixture(scope="module")
def features() -> FrameFeatures:
    rng = np.random.default_rng(4)
    frames = []
    for number in range(2):
        points = rng.uniform((-7, -7, -1.7), (7, 7, 2), (3000, 3)).astype(np.float32)
        frames.append(prepare(Frame(points, stamp=0.1 * number), SETTINGS))
    with torch.no_grad():
        encoded = _network(1.0).encode(to_tensors(frames), matchable=False)
    # One pillar in three passes the gate, one is doubtful, one is surely background.
    logits = torch.tensor([0.0, -2.0, -8.0]).repeat(len(encoded.foreground))
    return replace(encoded, foreground=logits[: len(encoded.foreground)])


def _chosen(network: Network, features: FrameFeatures) -> torch.Tensor:
    with torch.no_grad():
        return network.perceive(features, torch.eye(4).repeat(2, 1, 1), WINDOW).point


def test_without_glances_those_that_pass_the_gate_are_looked_at(features: FrameFeatures) -> None:
    passed = points_of(features.frames, close_pillars(features.foreground))
    assert torch.equal(_chosen(_network(1.0), features), passed)


def test_a_doubtful_pillar_is_looked_at_if_its_middle_point_passes(features: FrameFeatures) -> None:
    network = _network(0.01)
    with torch.no_grad():  # so that about half of the glances pass
        everything = torch.arange(len(features.frames.points))
        poses = torch.eye(4).repeat(2, 1, 1)
        seen = network.perceive(features, poses, WINDOW, everything)
        network.point_head.foreground.bias += FOREGROUND_GATE - seen.foreground.median()
        seen = network.perceive(features, poses, WINDOW, everything)
    pillar = features.frames.pillar
    expected = close_pillars(features.foreground)
    for one in torch.nonzero(features.foreground == -2.0)[:, 0].tolist():
        points = torch.nonzero(pillar == one)[:, 0]
        expected[one] = bool(seen.foreground[points[len(points) // 2]] > FOREGROUND_GATE)
    glanced = expected & (features.foreground == -2.0)
    assert 0 < glanced.sum() < (features.foreground == -2.0).sum()
    assert torch.equal(_chosen(network, features), points_of(features.frames, expected))
