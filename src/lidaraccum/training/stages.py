"""One window scored: each stage given the truth of those before it, then all of them together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from lidaraccum.metrics import segmentation
from lidaraccum.metrics.flow import FlowErrors, flow_errors
from lidaraccum.metrics.segmentation import SegmentationCounts
from lidaraccum.model.answers import Perception
from lidaraccum.model.batch import to_arrays
from lidaraccum.model.kabsch import move
from lidaraccum.model.network import Network
from lidaraccum.model.precision import inference
from lidaraccum.training.alone import answer_alone
from lidaraccum.training.end_to_end import EndToEnd, score_answer
from lidaraccum.training.objective import (
    object_poses,
    object_truth,
    offset_truth,
    source_index,
)
from lidaraccum.training.window import Batch


@dataclass(frozen=True, eq=False)
class StageScores:
    """What one window scored, stage by stage, and in the end all together.

    Attributes:
        foreground: Of annotated points.
        motion: Of annotated points, poses true.
        ego: Errors of the static points of each source frame, its pose the network's.
        offset: (D,) float64 metres: errors of the offsets of dynamic points, poses true.
        objects: Errors of dynamic source points, masks and poses true, motions TubeNet's.
        still: The same if every object stood still.
        alone: The network doing all of it itself.
    """

    foreground: SegmentationCounts
    motion: SegmentationCounts
    ego: list[FlowErrors]
    offset: NDArray[np.float64]
    objects: FlowErrors
    still: FlowErrors
    alone: EndToEnd


def score_stages(network: Network, batch: Batch) -> StageScores:
    """Score a network on a batch of one window."""
    truth = batch.truth
    with inference(batch.frames.points.device):
        features = network.encode(batch.frames)
        match = network.match_windows(features, batch.windows)
        view = network.view(features, truth.target_from_frame, batch.windows)
        close = torch.zeros_like(truth.foreground)
        close[network.choose(view, features)] = True
        points = torch.nonzero(close | (truth.object_row >= 0))[:, 0]
        told = network.look(view, points)
        objects, still = _object_errors(network, batch, told)
        answer = answer_alone(network, features, batch.windows, match.target_from_source)
    foreground, motion = _segmentation(batch, told, close[points])
    aligned = object_poses(batch, truth.target_from_frame)
    wanted, has = offset_truth(told, truth, aligned)
    has &= truth.dynamic[told.point]
    off = torch.linalg.vector_norm(told.offset - wanted, dim=1)[has]
    return StageScores(
        foreground, motion, _ego_errors(batch, match.target_from_source), to_arrays(off),
        objects, still, score_answer(answer, batch),
    )  # fmt: skip


def _segmentation(
    batch: Batch, perception: Perception, close: torch.Tensor
) -> tuple[SegmentationCounts, SegmentationCounts]:
    """Of points (Q,) looked at closely anyway; all others are background."""
    truth = batch.truth
    foreground = torch.zeros_like(truth.foreground)
    dynamic = torch.zeros_like(truth.foreground)
    movable = close & (perception.foreground > 0)
    foreground[perception.point] = movable
    dynamic[perception.point] = movable & (perception.dynamic > 0)
    told = truth.annotated
    return (
        segmentation.compare(foreground[told].cpu().numpy(), truth.foreground[told].cpu().numpy()),
        segmentation.compare(dynamic[told].cpu().numpy(), truth.dynamic[told].cpu().numpy()),
    )


def _ego_errors(batch: Batch, estimated: torch.Tensor) -> list[FlowErrors]:
    """Errors of each source frame's static points, target's sensor coordinates."""
    frames, truth = batch.frames, batch.truth
    owner = frames.point_frame
    errors = []
    for pose, index in zip(estimated, source_index(batch).tolist(), strict=True):
        own = (owner == index) & ~truth.dynamic
        sensor = move(torch.linalg.inv(frames.level_from_sensor[index]), frames.points[own])
        moved = move(pose, sensor) - sensor
        wanted = move(truth.target_from_frame[index], sensor) - sensor
        errors.append(flow_errors(to_arrays(moved), to_arrays(wanted)))
    return errors


def _object_errors(
    network: Network, batch: Batch, told: Perception
) -> tuple[FlowErrors, FlowErrors]:
    """Errors of dynamic source points of known objects, of TubeNet and of standing still."""
    truth = batch.truth
    row = truth.object_row[told.point]
    nothing = FlowErrors(np.zeros(0), np.zeros(0))
    if not (row >= 0).any():
        return nothing, nothing
    objects = network.track(told, row + 1)
    position, dynamic = told.position[row >= 0], truth.dynamic[told.point[row >= 0]]
    aligned = object_poses(batch, truth.target_from_frame)
    motion, _ = object_truth(objects, truth, aligned, objects.ids - 1)
    at = (objects.instance, objects.time)
    known = truth.known[objects.ids - 1][at]
    moving = dynamic & known & (objects.time != objects.tubes.anchor_time[objects.instance])
    points = position[moving][:, None]
    mine = (objects.instance[moving], objects.time[moving])
    there = move(objects.target_from_aligned[mine], points)[:, 0] - points[:, 0]
    wanted = move(motion[mine], points)[:, 0] - points[:, 0]
    true_flow = to_arrays(wanted)
    return flow_errors(to_arrays(there), true_flow), flow_errors(0.0 * true_flow, true_flow)
