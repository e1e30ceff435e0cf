"""Labelled frames to a training window: the truth in the network's own coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Labels
from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.geometry import rigid
from lidaraccum.model.batch import PreparedFrame, prepare
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.training.augment import LabelledFrame
from lidaraccum.training.window import PointTruth, TrainingWindow


def make_window(
    frames: Sequence[LabelledFrame],
    target: int,
    settings: NetworkSettings,
    extent_m: float | None = None,
) -> TrainingWindow:
    """Prepare frames in order of time and tell the truth about them.

    Args:
        frames: T frames with their labels.
        target: Index of the target.
        settings: The network's.
        extent_m: Side of the grid, metres; the settings' own when None.

    Raises:
        InputError: A frame has no point on the grid.
    """
    prepared = tuple(prepare(frame, settings, extent_m) for frame, _ in frames)
    labels = [label for _, label in frames]
    ids = _ids(prepared, labels)
    row_of = {int(instance): row for row, instance in enumerate(ids)}
    poses, known, still = _objects(prepared, labels, row_of)
    target_from_world = rigid.invert(labels[target].world_from_sensor)
    return TrainingWindow(
        frames=prepared,
        truth=tuple(
            _point_truth(frame, label, ids) for frame, label in zip(prepared, labels, strict=True)
        ),
        target=target,
        target_from_sensor=np.stack(
            [target_from_world @ label.world_from_sensor for label in labels]
        ),
        level_from_object=poses,
        known=known,
        still=still,
    )


def window_of(
    sequence: LabelledSequence,
    indices: Sequence[int],
    settings: NetworkSettings,
    extent_m: float | None = None,
) -> TrainingWindow:
    """Frames of a sequence as they are, the first the target; otherwise as `make_window`."""
    frames = [(sequence[index], sequence.labels(index)) for index in indices]
    return make_window(frames, 0, settings, extent_m)


def _ids(prepared: Sequence[PreparedFrame], labels: Sequence[Labels]) -> NDArray[np.int64]:
    """Ascending ids of the objects that have points on the grid in any frame."""
    seen = [
        np.unique(label.instance[frame.rows]) for frame, label in zip(prepared, labels, strict=True)
    ]
    ids = np.unique(np.concatenate(seen)).astype(np.int64)
    return ids[ids > 0]


def _point_truth(frame: PreparedFrame, labels: Labels, ids: NDArray[np.int64]) -> PointTruth:
    rows = frame.rows
    instance = labels.instance[rows]
    object_row = np.where(instance > 0, np.searchsorted(ids, instance), -1).astype(np.int32)
    annotated = labels.annotated
    return PointTruth(
        foreground=labels.foreground[rows],
        dynamic=labels.dynamic[rows],
        object_row=object_row,
        annotated=np.ones(len(rows), np.bool_) if annotated is None else annotated[rows],
    )


def _objects(
    prepared: Sequence[PreparedFrame], labels: Sequence[Labels], row_of: dict[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Poses (K, T, 4, 4) in each frame's level coordinates, known (K, T), still (K,)."""
    count, span = len(row_of), len(labels)
    poses = np.tile(np.eye(4), (count, span, 1, 1))
    known = np.zeros((count, span), dtype=np.bool_)
    still = np.ones(count, dtype=np.bool_)
    for time, (frame, label) in enumerate(zip(prepared, labels, strict=True)):
        for box in label.boxes:
            row = row_of.get(box.id)
            if row is not None:
                poses[row, time] = frame.level_from_sensor @ box.sensor_from_object
                known[row, time] = True
                still[row] &= not box.dynamic
    return poses, known, still
