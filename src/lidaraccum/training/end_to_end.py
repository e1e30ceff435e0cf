"""How the network does alone, scored as in the paper.

What `evaluation` does with whole pipelines, on one prepared window. Points off the grid are not
scored, and the truth moves points as they were measured: what a mover shifts within one sweep is
nobody's error here.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from lidaraccum.metrics import association, segmentation
from lidaraccum.metrics.association import AssociationScore, keep_majority
from lidaraccum.metrics.flow import SQUARE_HALF_WIDTH_M, flow_errors, inside_square
from lidaraccum.metrics.flow_parts import FlowByPart, summarise_by_part
from lidaraccum.metrics.segmentation import SegmentationCounts
from lidaraccum.model.batch import to_arrays, to_indices
from lidaraccum.model.kabsch import chain, invert, move
from lidaraccum.training.alone import Answer, move_frames
from lidaraccum.training.window import Batch


@dataclass(frozen=True, eq=False)
class EndToEnd:
    """How windows came out; two added are the scores of both.

    Attributes:
        flow: Of source points, to where they belong in the target frame.
        motion: Moving or not, points of all frames.
        association: Instances over all frames of a window, all objects.
        moving: The same, cut down on both sides to those that truly move.
    """

    flow: FlowByPart
    motion: SegmentationCounts
    association: AssociationScore
    moving: AssociationScore

    @classmethod
    def pool(cls, parts: Iterable[EndToEnd]) -> EndToEnd:
        """All windows of several; no part at all gives scores of no window."""
        whole = list(parts)
        return cls(
            FlowByPart.pool(part.flow for part in whole),
            SegmentationCounts.pool(part.motion for part in whole),
            AssociationScore.pool(part.association for part in whole),
            AssociationScore.pool(part.moving for part in whole),
        )


@dataclass(frozen=True, eq=False)
class Goal:
    """Where the P points of one window's frames belong.

    Attributes:
        start: (P, 3) float64 metres, their own frames' sensor coordinates.
        placed: (P, 3) float64 metres, target's sensor coordinates.
        known: (P,) bool: the truth knows; a mover not seen in the target frame belongs nowhere.
    """

    start: NDArray[np.float64]
    placed: NDArray[np.float64]
    known: NDArray[np.bool_]


def goal_of(batch: Batch) -> Goal:
    """The truth about a batch of one window: what moves in any frame follows its box."""
    frames, truth = batch.frames, batch.truth
    target, owner, row = batch.windows.target[0], frames.point_frame, truth.object_row
    sensor_from_level = invert(frames.level_from_sensor)
    start = move_frames(frames, sensor_from_level)
    placed = move_frames(frames, chain(truth.target_from_frame, sensor_from_level))
    known = ~truth.dynamic
    if len(truth.still):
        mover = ~truth.still
        mover[row[truth.dynamic & (row >= 0)]] = True
        here = truth.known.clone()
        seen = torch.zeros_like(mover)
        seen[row[(owner == target) & (row >= 0)]] = True
        here &= (seen & truth.known[:, target])[:, None]
        follows = (row >= 0) & mover[row.clamp_min(0)]
        mine, time = row[follows], owner[follows]
        motion = chain(
            sensor_from_level[target],
            truth.level_from_object[mine, target],
            invert(truth.level_from_object[mine, time]),
        )
        placed[follows] = move(motion, frames.points[follows][:, None])[:, 0]
        known[follows] = here[mine, time]
    return Goal(to_arrays(start), to_arrays(placed), known.cpu().numpy())


def score_answer(answer: Answer, batch: Batch) -> EndToEnd:
    """Compare with the truth inside the scored square of the target frame."""
    frames, truth = batch.frames, batch.truth
    goal = goal_of(batch)
    dynamic, foreground, annotated = (
        mask.cpu().numpy() for mask in (truth.dynamic, truth.foreground, truth.annotated)
    )
    half = min(frames.half_extent_m, SQUARE_HALF_WIDTH_M)
    scored = annotated & inside_square(goal.placed, half)
    flows = scored & goal.known & (to_indices(frames.point_frame) != batch.windows.target[0])
    start = goal.start[flows]
    errors = flow_errors(answer.placed[flows] - start, goal.placed[flows] - start)
    said, instance = answer.instance[scored], to_indices(truth.object_row)[scored] + 1
    moves = dynamic[scored]
    return EndToEnd(
        flow=summarise_by_part(errors, dynamic[flows], foreground[flows]),
        motion=segmentation.compare(answer.dynamic[scored], moves),
        association=association.score(said, instance),
        moving=association.score(keep_majority(said, moves), keep_majority(instance, moves)),
    )
