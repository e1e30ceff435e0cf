"""The network doing all of it with one of its parts left out, as in the paper's ablations."""

from __future__ import annotations

from typing import Literal, get_args

import torch

from lidaraccum.model.answers import FrameFeatures
from lidaraccum.model.kabsch import chain
from lidaraccum.model.network import Network
from lidaraccum.model.precision import inference
from lidaraccum.training.alone import answer_alone
from lidaraccum.training.end_to_end import EndToEnd, score_answer
from lidaraccum.training.window import Batch

Part = Literal["nothing", "foreground", "motion", "offsets", "direct poses"]
PARTS: tuple[Part, ...] = get_args(Part)
"""What is left out: nothing; the mask of what may move where frames are matched; the motion
segmentation; the offsets; matching each frame straight to the target, whose place is taken by poses
chained from frame to frame. Source: the paper, table 4; there a second network was trained without
foreground, here the mask is not used."""


def score_without(network: Network, batch: Batch) -> dict[Part, EndToEnd]:
    """Score a network on a batch of one window whose target comes first, each part left out.

    Raises:
        ValueError: The target is another frame.
    """
    windows = batch.windows
    if windows.target[0] != 0:
        raise ValueError("poses are chained to the first frame only")
    with inference(batch.frames.points.device):
        features = network.encode(batch.frames)
        everything = network.encode(batch.frames, masked=False)
        direct = network.match_windows(features, windows).target_from_source
        unmasked = network.match_windows(everything, windows).target_from_source
        asked: dict[Part, tuple[torch.Tensor, frozenset[str]]] = {
            "nothing": (direct, frozenset()),
            "foreground": (unmasked, frozenset()),
            "motion": (direct, frozenset({"motion"})),
            "offsets": (direct, frozenset({"offsets"})),
            "direct poses": (chained_poses(network, features), frozenset()),
        }
        answers = {
            part: answer_alone(network, features, windows, poses, without)
            for part, (poses, without) in asked.items()
        }
    return {part: score_answer(answer, batch) for part, answer in answers.items()}


def chained_poses(network: Network, features: FrameFeatures) -> torch.Tensor:
    """Poses first_from_frame (T - 1, 4, 4) of all frames but the first, from one to the next."""
    stamps = torch.tensor(features.frames.stamps, dtype=torch.float64)
    later = torch.arange(1, len(features))
    gaps = (stamps[1:] - stamps[:-1]).float().to(features.foreground.device)
    steps = network.matcher(features.ego.pick(later), features.ego.pick(later - 1), gaps)
    poses = [steps.target_from_source[0]]
    for step in steps.target_from_source[1:]:
        poses.append(chain(poses[-1], step))
    return torch.stack(poses)
