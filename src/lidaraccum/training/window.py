"""A training window: prepared frames with the truth about them, and many of them as tensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from lidaraccum.model.batch import FrameTensors, PreparedFrame, to_tensors
from lidaraccum.model.kabsch import chain, invert
from lidaraccum.model.motion import Windows


@dataclass(frozen=True, eq=False)
class PointTruth:
    """The truth about the N points of a prepared frame, row by row.

    Attributes:
        foreground: (N,) bool.
        dynamic: (N,) bool.
        object_row: (N,) int32: row of the point's object among the window's, -1 for none.
        annotated: (N,) bool: only such points teach.
    """

    foreground: NDArray[np.bool_]
    dynamic: NDArray[np.bool_]
    object_row: NDArray[np.int32]
    annotated: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class TrainingWindow:
    """T frames in order of time, one of them the target, and the truth. Picklable.

    Attributes:
        frames: T prepared frames on one grid.
        truth: T truths about their points.
        target: Index of the target frame.
        target_from_sensor: (T, 4, 4) true poses, sensor coordinates.
        level_from_object: (K, T, 4, 4) true pose of each object in each frame's level coordinates.
        known: (K, T) bool: whether that pose is known.
        still: (K,) bool: the object does not move in any of the frames.
    """

    frames: tuple[PreparedFrame, ...]
    truth: tuple[PointTruth, ...]
    target: int
    target_from_sensor: NDArray[np.float64]
    level_from_object: NDArray[np.float64]
    known: NDArray[np.bool_]
    still: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Truth:
    """The truth about F frames with P points in W windows with K objects, on a device.

    Attributes:
        foreground: (P,) bool.
        dynamic: (P,) bool.
        object_row: (P,) int64 row of the point's object, -1 for none.
        annotated: (P,) bool.
        target_from_frame: (F, 4, 4) float32 true poses, sensor coordinates.
        level_target_from_frame: (F, 4, 4) float32 the same between level coordinates.
        level_from_object: (K, T, 4, 4) float32, T the longest window's.
        known: (K, T) bool.
        still: (K,) bool.
        first_frame: (K,) int64 index of the first frame of each object's window.
    """

    foreground: torch.Tensor
    dynamic: torch.Tensor
    object_row: torch.Tensor
    annotated: torch.Tensor
    target_from_frame: torch.Tensor
    level_target_from_frame: torch.Tensor
    level_from_object: torch.Tensor
    known: torch.Tensor
    still: torch.Tensor
    first_frame: torch.Tensor


@dataclass(frozen=True, eq=False)
class Batch:
    """W windows ready for a step."""

    frames: FrameTensors
    windows: Windows
    truth: Truth


def make_batch(windows: Sequence[TrainingWindow], device: torch.device | str = "cpu") -> Batch:
    """Windows, all on one grid, one after another on a device."""
    lengths = tuple(len(window.frames) for window in windows)
    firsts = np.cumsum([0, *lengths[:-1]])
    which = Windows(
        lengths,
        tuple(int(first) + window.target for first, window in zip(firsts, windows, strict=True)),
    )
    frames = to_tensors([frame for window in windows for frame in window.frames], device)
    return Batch(frames, which, _make_truth(windows, firsts, frames, which))


def _make_truth(
    windows: Sequence[TrainingWindow],
    firsts: NDArray[np.int64],
    frames: FrameTensors,
    which: Windows,
) -> Truth:
    device = frames.points.device
    objects = [len(window.still) for window in windows]
    before = np.cumsum([0, *objects[:-1]])
    truths = [truth for window in windows for truth in window.truth]
    rows = [
        np.where(truth.object_row >= 0, truth.object_row.astype(np.int64) + start, -1)
        for window, start in zip(windows, before, strict=True)
        for truth in window.truth
    ]

    def put(array: NDArray[np.generic]) -> torch.Tensor:
        return torch.from_numpy(array).to(device, non_blocking=True)

    poses = np.concatenate([window.target_from_sensor for window in windows])
    target_from_frame = put(poses.astype(np.float32))
    of_target = frames.level_from_sensor[torch.tensor(which.target_of_frame, device=device)]
    longest = max(which.lengths)
    return Truth(
        foreground=put(np.concatenate([truth.foreground for truth in truths])),
        dynamic=put(np.concatenate([truth.dynamic for truth in truths])),
        object_row=put(np.concatenate(rows)),
        annotated=put(np.concatenate([truth.annotated for truth in truths])),
        target_from_frame=target_from_frame,
        level_target_from_frame=chain(
            of_target, target_from_frame, invert(frames.level_from_sensor)
        ),
        level_from_object=put(
            np.concatenate([_lengthen(window.level_from_object, longest) for window in windows])
        ),
        known=put(np.concatenate([_lengthen_known(window.known, longest) for window in windows])),
        still=put(np.concatenate([window.still for window in windows])),
        first_frame=put(np.repeat(firsts, objects)),
    )


def _lengthen(poses: NDArray[np.float64], length: int) -> NDArray[np.float32]:
    longer = np.tile(np.eye(4, dtype=np.float32), (len(poses), length, 1, 1))
    longer[:, : poses.shape[1]] = poses
    return longer


def _lengthen_known(known: NDArray[np.bool_], length: int) -> NDArray[np.bool_]:
    longer = np.zeros((len(known), length), dtype=np.bool_)
    longer[:, : known.shape[1]] = known
    return longer
