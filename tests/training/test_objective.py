"""The loss of a batch: what an oracle would score, and that its gradient reaches every weight."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import pytest
import torch

from lidaraccum.errors import SettingsError
from lidaraccum.model.kabsch import chain, invert, move
from lidaraccum.model.motion import Windows
from lidaraccum.model.network import build_network
from lidaraccum.training.clusters import TRUE_CLUSTERS
from lidaraccum.training.objective import (
    ObjectiveSettings,
    object_poses,
    objective,
    true_motion,
)
from lidaraccum.training.window import Batch, make_batch


@pytest.fixture(scope="module")
def batch(toy: ModuleType) -> Batch:
    windows = toy.CarParks().windows(0) + toy.CarParks().windows(1)
    return make_batch(windows)


def test_true_poses_lay_objects_of_all_times_on_each_other(batch: Batch) -> None:
    """The truth is consistent: static and moving points fall together once both are undone."""
    truth, frames = batch.truth, batch.frames
    level = truth.level_target_from_frame
    aligned = object_poses(batch, truth.target_from_frame)
    motion = true_motion(aligned, torch.zeros(len(truth.still), dtype=torch.int64))
    row, frame = truth.object_row, frames.point_frame
    own = row >= 0
    time = frame - truth.first_frame[row.clamp_min(0)]
    here = move(level[frame[own]], frames.points[own][:, None])
    home = move(motion[row[own], time[own]], here)[:, 0]
    in_box = move(invert(aligned[row[own], 0]), home[:, None])[:, 0]
    assert float(in_box[:, 0].abs().max()) < 2.15
    assert float(in_box[:, 1].abs().max()) < 0.95


def test_windows_of_different_lengths_share_a_batch(batch: Batch) -> None:
    assert len(set(batch.windows.lengths)) > 1 or sum(batch.windows.lengths) == len(batch.frames)
    for window, target in enumerate(batch.windows.target):
        assert batch.windows.of_frame[target] == window
        pose = batch.truth.target_from_frame[target]
        torch.testing.assert_close(pose, torch.eye(4), atol=1e-6, rtol=0)


@pytest.mark.parametrize("poses", ["true", "noisy", "own"])
def test_every_weight_learns(batch: Batch, toy: ModuleType, poses: str) -> None:
    network = build_network(toy.SMALL).train()
    settings = ObjectiveSettings(poses=poses)
    losses = objective(network, batch, settings, torch.Generator().manual_seed(1))
    losses.total.backward()
    silent = [
        name
        for name, parameter in network.named_parameters()
        if parameter.grad is None or not parameter.grad.any()
    ]
    assert silent == []
    assert all(torch.isfinite(p.grad).all() for p in network.parameters())


def test_a_detached_motion_branch_leaves_the_backbone_alone(batch: Batch, toy: ModuleType) -> None:
    network = build_network(toy.SMALL).train()
    settings = ObjectiveSettings(detach_motion=True, clusters=TRUE_CLUSTERS)
    losses = objective(network, batch, settings, torch.Generator().manual_seed(1))
    (losses.motion + losses.offset).backward()
    assert all(parameter.grad is None for parameter in network.backbone.parameters())


def test_the_terms_count_as_they_are_weighted(batch: Batch, toy: ModuleType) -> None:
    network = build_network(toy.SMALL)
    settings = ObjectiveSettings(ego_weight=3.0, offset_weight=0.25, object_weight=0.0)
    losses = objective(network, batch, settings, torch.Generator().manual_seed(2))
    plain = 3.0 * losses.ego + losses.foreground + losses.motion + 0.25 * losses.offset
    torch.testing.assert_close(losses.total, plain)
    with pytest.raises(SettingsError, match="weights"):
        ObjectiveSettings(offset_weight=-0.1)


def test_tube_net_learns_alone(batch: Batch, toy: ModuleType) -> None:
    network = build_network(toy.SMALL).train()
    settings = ObjectiveSettings(tube_alone=True, object_weight=0.5, cluster_draws=3)
    losses = objective(network, batch, settings, torch.Generator().manual_seed(1))
    total, *others, objects = losses.numbers()
    assert (others, total) == ([0.0] * 4, pytest.approx(0.5 * objects))
    losses.total.backward()
    for name, parameter in network.named_parameters():
        assert (parameter.grad is not None) == name.startswith("tube_net."), name
    with pytest.raises(SettingsError, match="TubeNet alone"):
        ObjectiveSettings(tube_alone=True, poses="own")


def test_objects_made_wrong_several_times_are_averaged(batch: Batch, toy: ModuleType) -> None:
    """Objects as they are come out the same each time."""
    network = build_network(toy.SMALL)
    settings = ObjectiveSettings(poses="true", clusters=TRUE_CLUSTERS)
    once, often = (
        objective(network, batch, replace(settings, cluster_draws=draws), generator).objects
        for draws in (1, 3)
        for generator in (torch.Generator().manual_seed(4),)
    )
    torch.testing.assert_close(often, once)


def test_turns_count_as_they_are_weighted(batch: Batch, toy: ModuleType) -> None:
    network = build_network(toy.SMALL)
    terms = [
        objective(
            network,
            batch,
            ObjectiveSettings(rotation_weight=weight),
            torch.Generator().manual_seed(4),
        ).objects
        for weight in (0.0, 10.0, 20.0)
    ]
    torch.testing.assert_close(terms[2] - terms[1], terms[1] - terms[0])
    assert terms[1] > terms[0]


def test_the_same_lot_gives_the_same_loss(batch: Batch, toy: ModuleType) -> None:
    network = build_network(toy.SMALL)
    numbers = [
        objective(network, batch, ObjectiveSettings(), torch.Generator().manual_seed(2)).numbers()
        for _ in range(2)
    ]
    assert numbers[0] == numbers[1]


def test_gaps_are_counted_from_the_target() -> None:
    windows = Windows((2, 3), (1, 2))
    assert windows.gaps((0.0, 0.1, 5.0, 5.2, 5.3)) == pytest.approx([-0.1, 0.0, 0.0, 0.2, 0.3])
    assert torch.equal(chain(torch.eye(4), torch.eye(4)), torch.eye(4))
