"""How good the network is on windows it does not learn from: stage by stage, and all together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from lidaraccum.metrics.segmentation import SegmentationCounts
from lidaraccum.model.network import Network
from lidaraccum.training.end_to_end import EndToEnd
from lidaraccum.training.stages import StageScores, score_stages
from lidaraccum.training.window import Batch


@dataclass(frozen=True)
class Scores:
    """Scores of the network alone; NaN where there was nothing to score.

    Down to ``object_still_m`` each stage is given the truth of those before it; from
    ``static_epe_m`` on the network does all of it itself, as in the paper's tables.

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
        static_epe_m: Mean error of the flow of static source points, false movers among them.
        static_acc_strict: Share of them within 5 cm or 5 %.
        still_epe_m: Mean error of those of them on something that can move.
        dynamic_epe_m: Mean error of the flow of dynamic source points.
        dynamic_median_m: Median of the same.
        dynamic_acc_strict: Share of them within 5 cm or 5 %.
        dynamic_acc_relaxed: Share within 10 cm or 10 %.
        dynamic_robust_outlier: Share off by more than 30 cm and more than 30 %.
        alone_motion_iou: Of annotated points, own poses, 0..1.
        alone_motion_precision: 0..1.
        alone_motion_recall: 0..1.
        coverage: WCov of all objects, 0..1.
        moving_coverage: WCov of those that truly move, 0..1.
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
    static_epe_m: float
    static_acc_strict: float
    still_epe_m: float
    dynamic_epe_m: float
    dynamic_median_m: float
    dynamic_acc_strict: float
    dynamic_acc_relaxed: float
    dynamic_robust_outlier: float
    alone_motion_iou: float
    alone_motion_precision: float
    alone_motion_recall: float
    coverage: float
    moving_coverage: float


def score_network(network: Network, batches: Iterable[Batch]) -> Scores:
    """Score a network on batches of one window each."""
    was_training = network.training
    network.eval()
    with torch.no_grad():
        answers = [score_stages(network, batch) for batch in batches]
    network.train(was_training)
    return scores_of(answers)


def scores_of(answers: Sequence[StageScores]) -> Scores:
    """Scores of any number of windows together."""
    alone = EndToEnd.pool(answer.alone for answer in answers)
    static, dynamic = alone.flow.static, alone.flow.dynamic
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
        static_epe_m=static.epe_mean,
        static_acc_strict=static.acc_strict,
        still_epe_m=alone.flow.static_foreground.epe_mean,
        dynamic_epe_m=dynamic.epe_mean,
        dynamic_median_m=dynamic.epe_median,
        dynamic_acc_strict=dynamic.acc_strict,
        dynamic_acc_relaxed=dynamic.acc_relaxed,
        dynamic_robust_outlier=dynamic.robust_outlier,
        alone_motion_iou=alone.motion.iou,
        alone_motion_precision=alone.motion.precision,
        alone_motion_recall=alone.motion.recall,
        coverage=alone.association.weighted_coverage,
        moving_coverage=alone.moving.weighted_coverage,
    )


def _mean(parts: list[NDArray[np.float64]]) -> float:
    values = np.concatenate([np.zeros(0), *parts])
    return float(values.mean()) if len(values) else float("nan")
