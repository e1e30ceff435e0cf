"""What is left out is left out, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
import torch

from lidaraccum.model.answers import FrameFeatures
from lidaraccum.model.motion import Windows
from lidaraccum.model.network import Network, build_network
from lidaraccum.training.ablations import PARTS, chained_poses, score_without
from lidaraccum.training.stages import score_stages
from lidaraccum.training.window import Batch, make_batch


@pytest.fixture(scope="module")
def batch(toy: ModuleType) -> Batch:
    windows = [window for drive in range(4) for window in toy.CarParks().windows(drive)]
    first = next(one for one in windows if make_batch([one]).windows.target[0] == 0)
    return make_batch([first])


@pytest.fixture(scope="module")
def eager(toy: ModuleType) -> Network:
    """Takes most for movable, some of it for moving."""
    network = build_network(toy.SMALL, 3).eval()
    network.foreground_head[2].bias.data.fill_(0.3)
    network.point_head.foreground.bias.data.fill_(1.0)
    return network


def test_with_nothing_left_out_it_is_the_network_alone(eager: Network, batch: Batch) -> None:
    with torch.no_grad():
        scored = score_without(eager, batch)
        alone = score_stages(eager, batch).alone
    assert tuple(scored) == PARTS
    assert scored["nothing"].flow.static.epe_mean == alone.flow.static.epe_mean
    assert scored["nothing"].motion == alone.motion


def test_without_motion_segmentation_all_that_may_move_does(eager: Network, batch: Batch) -> None:
    with torch.no_grad():
        scored = score_without(eager, batch)
    said = {
        part: one.motion.true_positive + one.motion.false_positive for part, one in scored.items()
    }
    assert said["motion"] > said["nothing"]
    assert said["offsets"] == said["nothing"]


def test_two_frames_are_chained_as_they_are_matched(eager: Network, batch: Batch) -> None:
    with torch.no_grad():
        features = eager.encode(batch.frames)
        chained = chained_poses(eager, features)
        direct = eager.match_windows(features, batch.windows).target_from_source
        two = FrameFeatures.stack([features.select(0), features.select(1)])
        step = chained_poses(eager, two)
        straight = eager.match_windows(two, Windows.single(2)).target_from_source
    assert chained.shape == direct.shape
    assert torch.equal(step, straight)
    torch.testing.assert_close(chained[0], direct[0], atol=1e-5, rtol=0)
    if len(direct) > 1:
        assert not torch.equal(chained[1], direct[1])


def test_another_target_is_refused(eager: Network, batch: Batch) -> None:
    count = len(batch.frames)
    with pytest.raises(ValueError, match="first"):
        score_without(eager, replace(batch, windows=Windows.single(count, target=count - 1)))


def test_without_the_mask_pillars_are_drawn_of_what_may_move(eager: Network, batch: Batch) -> None:
    with torch.no_grad():
        masked, all_of_it = (
            eager.encode(batch.frames, masked=masked).ego.valid.sum() for masked in (True, False)
        )
    assert np.less(int(masked), int(all_of_it))
