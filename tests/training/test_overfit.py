"""The graph on the real loss: a few windows can be learned by heart."""

from __future__ import annotations

import math
from types import ModuleType

import pytest
import torch

from lidaraccum.model.network import build_network
from lidaraccum.training.clusters import TRUE_CLUSTERS
from lidaraccum.training.objective import ObjectiveSettings, objective
from lidaraccum.training.scores import score_network
from lidaraccum.training.trainer import clip_gradients
from lidaraccum.training.window import make_batch

STEPS = 150


@pytest.mark.slow
def test_two_windows_are_learned_by_heart(toy: ModuleType) -> None:
    windows = toy.CarParks().windows(0)
    batch, batches = make_batch(windows), [make_batch([window]) for window in windows]
    network = build_network(toy.SMALL).train()
    optimiser = torch.optim.Adam(network.parameters())
    settings = ObjectiveSettings(poses="true", clusters=TRUE_CLUSTERS)
    before = score_network(network, batches)
    for step in range(STEPS):
        rate = 3e-3 * (0.505 + 0.495 * math.cos(math.pi * step / STEPS))
        optimiser.param_groups[0]["lr"] = rate
        generator = torch.Generator().manual_seed(step)
        losses = objective(network, batch, settings, generator)
        optimiser.zero_grad()
        losses.total.backward()
        clip_gradients(network, 5.0)
        optimiser.step()
    after = score_network(network, batches)
    assert after.foreground_iou > 0.8
    assert after.motion_iou > 0.7
    # Points are drawn anew in every frame, so pillars only match roughly.
    assert after.ego_epe_m < 0.55 * before.ego_epe_m
    assert after.object_epe_m < 0.3 * after.object_still_m
