"""Which points of a window are looked at closely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from lidaraccum.data.frame import Frame
from lidaraccum.model.answers import FrameFeatures
from lidaraccum.model.batch import prepare, to_tensors
from lidaraccum.model.looking import BESIDE_M, FOREGROUND_GATE, close_pillars, points_of
from lidaraccum.model.motion import Windows
from lidaraccum.model.network import Network, build_network
from lidaraccum.model.settings import NetworkSettings

SETTINGS = NetworkSettings(
    extent_m=16.0, base_widths=(16, 24, 32), motion_widths=(32, 48), ego_pillars=64,
    temporal_channels=16, temporal_blocks=1, point_channels=48, tube_channels=48,
)  # fmt: skip
WINDOW = Windows.single(2)


def _network(glance_odds: float, beside_odds: float = 1.0) -> Network:
    asked = replace(SETTINGS, glance_odds=glance_odds, beside_odds=beside_odds)
    return build_network(asked).eval()


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


def test_beside_what_moves_its_own_parts_are_looked_for(features: FrameFeatures) -> None:
    network = _network(1.0, 0.01)
    frames = features.frames
    everything, poses = torch.arange(len(frames.points)), torch.eye(4).repeat(2, 1, 1)
    count = torch.bincount(frames.pillar)
    middle = count.cumsum(0) - count + count // 2
    with torch.no_grad():
        network.point_head.foreground.bias += 10.0
        for one in range(len(middle) // 2, len(middle)):
            alone = torch.full_like(features.foreground, -2.0)
            alone[one] = 0.0  # one pillar passes the gate, all others are doubtful
            features = replace(features, foreground=alone)
            said = network.perceive(features, poses, WINDOW, everything).dynamic[middle]
            if said[one] > said.median() + 0.01:
                break
        network.point_head.dynamic.bias -= said.median()  # half of all pillars move
    moves = said > said.median() + 1e-4
    centres = frames.pillar_centres()
    away = (centres - centres[one]).abs().amax(dim=1)
    near = (away < BESIDE_M + 0.01) & (frames.pillar_frame == frames.pillar_frame[one])
    expected = near & moves
    assert 10 < expected.sum() < near.sum() < len(near) / 4
    assert torch.equal(_chosen(network, features), points_of(frames, expected))
    with torch.no_grad():
        network.point_head.dynamic.bias -= 10.0  # it does not move after all
    alone_passes = points_of(frames, close_pillars(alone))
    assert torch.equal(_chosen(network, features), alone_passes)
