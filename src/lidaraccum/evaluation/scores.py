"""The scores of windows: made for one window, added up for any number."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.accumulation import BACKGROUND, MOVING, AccumulatedFrame
from lidaraccum.evaluation.categories import CATEGORIES
from lidaraccum.evaluation.parts import Parts, added, score_parts
from lidaraccum.evaluation.truth import FrameTruth, WindowTruth
from lidaraccum.metrics import association, segmentation
from lidaraccum.metrics.association import AssociationScore, keep_majority
from lidaraccum.metrics.averages import ratio
from lidaraccum.metrics.flow import FlowErrors, flow_errors
from lidaraccum.metrics.flow_parts import FlowByPart, summarise_by_part
from lidaraccum.metrics.flow_speeds import FlowBySpeed, summarise_by_speed
from lidaraccum.metrics.segmentation import SegmentationCounts
from lidaraccum.metrics.trajectory import (
    PoseErrors,
    absolute_errors,
    pairs_by_frames,
    relative_errors,
)


def _no_flow() -> FlowByPart:
    return FlowByPart.pool(())


@dataclass(frozen=True, eq=False)
class Scores:
    """What any number of windows scored; two added are the scores of all windows of both.

    Attributes:
        windows: How many.
        flow: Of source points, to where they belong in the target frame.
        by_gap: The same by frames between source and target.
        by_speed: The same by kind of object and true speed.
        by_part: Counts by range, kind, speed and sensor.
        motion: Moving or not, points of all frames.
        foreground: Movable or not, points of all frames.
        association: Instances over all frames of a window, all objects.
        moving_association: The same, instances cut down on both sides to those that truly move.
        absolute: Poses of the source frames, in the target frame.
        relative: Motions from frame to frame.
        unknown_points: Source points left out of ``flow``: their object is not known in the target
            frame.
        seconds: CPU time of the pipeline, all threads, reading not counted; so that what else the
            machine does is not counted either.
    """

    windows: int = 0
    flow: FlowByPart = field(default_factory=_no_flow)
    by_gap: Mapping[int, FlowByPart] = field(default_factory=dict)
    by_speed: FlowBySpeed = field(default_factory=lambda: FlowBySpeed.pool((), CATEGORIES))
    by_part: Parts = field(default_factory=dict)
    motion: SegmentationCounts = field(default_factory=SegmentationCounts)
    foreground: SegmentationCounts = field(default_factory=SegmentationCounts)
    association: AssociationScore = field(default_factory=lambda: AssociationScore.pool(()))
    moving_association: AssociationScore = field(default_factory=lambda: AssociationScore.pool(()))
    absolute: PoseErrors = field(default_factory=lambda: PoseErrors.pool(()))
    relative: PoseErrors = field(default_factory=lambda: PoseErrors.pool(()))
    unknown_points: int = 0
    seconds: float = 0.0

    @classmethod
    def pool(cls, parts: Iterable[Scores]) -> Scores:
        """All windows of several; no part at all gives scores of no window."""
        return sum(parts, start=cls())

    def __add__(self, other: Scores) -> Scores:
        gaps = sorted({*self.by_gap, *other.by_gap})
        return Scores(
            windows=self.windows + other.windows,
            flow=self.flow + other.flow,
            by_gap={
                gap: FlowByPart.pool(one.by_gap[gap] for one in (self, other) if gap in one.by_gap)
                for gap in gaps
            },
            by_speed=self.by_speed + other.by_speed,
            by_part=added((self.by_part, other.by_part)),
            motion=self.motion + other.motion,
            foreground=self.foreground + other.foreground,
            association=self.association + other.association,
            moving_association=self.moving_association + other.moving_association,
            absolute=PoseErrors.pool((self.absolute, other.absolute)),
            relative=PoseErrors.pool((self.relative, other.relative)),
            unknown_points=self.unknown_points + other.unknown_points,
            seconds=self.seconds + other.seconds,
        )

    @property
    def seconds_per_window(self) -> float:
        """Mean CPU time of the pipeline; NaN when there is no window."""
        return ratio(self.seconds, self.windows)


def score_window(
    placed: Sequence[AccumulatedFrame],
    truth: WindowTruth,
    target: int,
    seconds: float,
    sensor: str = "",
) -> Scores:
    """Compare where the pipeline put the points of a window with where they belong.

    Args:
        placed: T frames in the target frame's coordinates, all their points in order.
        truth: Of the same frames.
        target: Index of the target frame.
        seconds: CPU time of the pipeline.
        sensor: What took the window; empty where nobody says.
    """
    by_gap: dict[int, FlowByPart] = {}
    by_speed: list[FlowBySpeed] = []
    unknown = 0
    for index, (frame, true) in enumerate(zip(placed, truth.frames, strict=True)):
        if index == target:
            continue
        gap = abs(index - target)
        errors = _errors(frame, true)
        flow = summarise_by_part(errors, *_of_known(true, true.dynamic, true.foreground))
        way_m, category = _of_known(true, true.way_m, true.category)
        seconds_apart = frame.stamp - placed[target].stamp
        by_speed.append(summarise_by_speed(errors, way_m, seconds_apart, category, CATEGORIES))
        by_gap[gap] = by_gap[gap] + flow if gap in by_gap else flow
        unknown += int(np.count_nonzero(true.scored & ~true.known))
    estimated = np.stack([frame.reference_from_sensor for frame in placed])
    sources = np.arange(len(placed)) != target
    pairs = pairs_by_frames(len(placed), 1)
    whole, moving = _association(placed, truth.frames)
    return Scores(
        windows=1,
        flow=FlowByPart.pool(by_gap.values()),
        by_gap=by_gap,
        by_speed=FlowBySpeed.pool(by_speed, CATEGORIES),
        by_part=score_parts(placed, truth, target, sensor),
        motion=SegmentationCounts.pool(map(_motion, placed, truth.frames)),
        foreground=SegmentationCounts.pool(map(_foreground, placed, truth.frames)),
        association=whole,
        moving_association=moving,
        absolute=absolute_errors(estimated[sources], truth.poses[sources]),
        relative=relative_errors(estimated, truth.poses, pairs),
        unknown_points=unknown,
        seconds=seconds,
    )


def _of_known(true: FrameTruth, *values: NDArray[Any]) -> list[NDArray[Any]]:
    """Only the rows whose place is scored and known."""
    rows = true.scored & true.known
    return [one[rows] for one in values]


def _errors(frame: AccumulatedFrame, true: FrameTruth) -> FlowErrors:
    put, start, goal = _of_known(true, frame.points, true.at_stamp, true.in_target)
    return flow_errors(put - start, goal - start)


def _motion(frame: AccumulatedFrame, true: FrameTruth) -> SegmentationCounts:
    return segmentation.compare((frame.label == MOVING)[true.scored], true.dynamic[true.scored])


def _foreground(frame: AccumulatedFrame, true: FrameTruth) -> SegmentationCounts:
    movable = (frame.label != BACKGROUND)[true.scored]
    return segmentation.compare(movable, true.foreground[true.scored])


def _association(
    placed: Sequence[AccumulatedFrame], frames: Sequence[FrameTruth]
) -> tuple[AssociationScore, AssociationScore]:
    """Scores of all instances, and of those that move."""
    predicted = _joined(
        [one.instance[true.scored] for one, true in zip(placed, frames, strict=True)]
    )
    instance = _joined([true.instance[true.scored] for true in frames])
    dynamic = np.concatenate([true.dynamic[true.scored] for true in frames])
    moving = association.score(keep_majority(predicted, dynamic), keep_majority(instance, dynamic))
    return association.score(predicted, instance), moving


def _joined(parts: Sequence[NDArray[np.int32]]) -> NDArray[np.int64]:
    return np.concatenate(parts).astype(np.int64)
