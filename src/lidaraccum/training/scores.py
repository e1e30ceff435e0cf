"""How good the network is on windows it does not learn from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch

from lidaraccum.metrics import segmentation
from lidaraccum.metrics.flow import FlowErrors, flow_errors
from lidaraccum.metrics.segmentation import SegmentationCounts
from lidaraccum.model.batch import to_arrays
from lidaraccum.model.kabsch import move
from lidaraccum.model.network import Network, Perception
from lidaraccum.model.precision import inference
from lidaraccum.training.objective import (
    object_poses,
    object_truth,
    offset_truth,
    source_index,
)
from lidaraccum.training.window import Batch


@dataclass(frozen=True)
class Scores:
    """Scores of the network alone; NaN where there was nothing to score.

    Attributes:
        windows: How many were scored.
        foreground_iou: Of annotated points, 0..1.
        foreground_precision: 0..1.
        foreground_recall: 0..1.
        motion_iou: Of annotated points, poses true, 0..1.
        motion_precision: 0..1.
        motion_recall: 0..1.
        ego_epe_m: Mean distance of static source points from where the true pose puts them.
        ego_epe_median_m: Median over pairs of frames of the same.
        offset_m: Mean error of the offsets of dynamic points.
        object_epe_m: Mean error of dynamic source points, true masks, true poses, TubeNet's motion.
        object_still_m: The same if every object were taken to stand still.
    """

    windows: int
    foreground_iou: float
    foreground_precision: float
    foreground_recall: float
    motion_iou: float
    motion_precision: float
    motion_recall: float
    ego_epe_m: float
    ego_epe_median_m: float
    offset_m: float
    object_epe_m: float
    object_still_m: float


@dataclass(frozen=True, eq=False)
class _Answers:
    foreground: SegmentationCounts
    motion: SegmentationCounts
    ego: list[FlowErrors]
    offset: np.ndarray
    objects: FlowErrors
    still: FlowErrors


def score_network(network: Network, batches: Iterable[Batch]) -> Scores:
    """Score a network on batches of one window each, poses of the motion branch true."""
    was_training = network.training
    network.eval()
    with torch.no_grad():
        answers = [_answer(network, batch) for batch in batches]
    network.train(was_training)
    foreground = SegmentationCounts.pool(answer.foreground for answer in answers)
    motion = SegmentationCounts.pool(answer.motion for answer in answers)
    pairs = [errors.epe.mean() for answer in answers for errors in answer.ego if len(errors)]
    return Scores(
        windows=len(answers),
        foreground_iou=foreground.iou,
        foreground_precision=foreground.precision,
        foreground_recall=foreground.recall,
        motion_iou=motion.iou,
        motion_precision=motion.precision,
        motion_recall=motion.recall,
        ego_epe_m=_mean([errors.epe for answer in answers for errors in answer.ego]),
        ego_epe_median_m=float(np.median(pairs)) if pairs else float("nan"),
        offset_m=_mean([answer.offset for answer in answers]),
        object_epe_m=_mean([answer.objects.epe for answer in answers]),
        object_still_m=_mean([answer.still.epe for answer in answers]),
    )


def _mean(parts: list[np.ndarray]) -> float:
    values = np.concatenate([np.zeros(0), *parts])
    return float(values.mean()) if len(values) else float("nan")


def _answer(network: Network, batch: Batch) -> _Answers:
    truth = batch.truth
    with inference(batch.frames.points.device):
        features = network.encode(batch.frames)
        match = network.match_windows(features, batch.windows)
        perception = network.perceive(features, truth.target_from_frame, batch.windows)
        true_points = torch.nonzero(truth.object_row >= 0)[:, 0]
        oracle = network.perceive(
            features, truth.target_from_frame, batch.windows, points=true_points
        )
        objects, still = _object_errors(network, batch, oracle)
    foreground, motion = _segmentation(batch, perception)
    aligned = object_poses(batch, truth.target_from_frame)
    wanted, has = offset_truth(oracle, truth, aligned)
    has &= truth.dynamic[oracle.point]
    off = torch.linalg.vector_norm(oracle.offset - wanted, dim=1)[has]
    return _Answers(
        foreground, motion, _ego_errors(batch, match.target_from_source), to_arrays(off),
        objects, still,
    )  # fmt: skip


def _segmentation(
    batch: Batch, perception: Perception
) -> tuple[SegmentationCounts, SegmentationCounts]:
    truth = batch.truth
    foreground = torch.zeros_like(truth.foreground)
    dynamic = torch.zeros_like(truth.foreground)
    movable = perception.foreground > 0
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
    network: Network, batch: Batch, oracle: Perception
) -> tuple[FlowErrors, FlowErrors]:
    """Errors of dynamic source points of known objects, of TubeNet and of standing still."""
    truth = batch.truth
    row = truth.object_row[oracle.point]
    nothing = FlowErrors(np.zeros(0), np.zeros(0))
    if len(row) == 0:
        return nothing, nothing
    objects = network.track(oracle, row + 1)
    aligned = object_poses(batch, truth.target_from_frame)
    motion, _ = object_truth(objects, truth, aligned, objects.ids - 1)
    tubes = objects.tubes
    at = (tubes.instance, tubes.time)
    known = truth.known[objects.ids - 1][at]
    moving = truth.dynamic[oracle.point] & known & (tubes.time != tubes.anchor_time[at[0]])
    points = oracle.position[moving][:, None]
    mine = (tubes.instance[moving], tubes.time[moving])
    there = move(objects.target_from_aligned[mine], points)[:, 0] - points[:, 0]
    wanted = move(motion[mine], points)[:, 0] - points[:, 0]
    true_flow = to_arrays(wanted)
    return flow_errors(to_arrays(there), true_flow), flow_errors(0.0 * true_flow, true_flow)
