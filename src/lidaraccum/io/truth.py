"""The truth about a frame's points, read from the labelled layout and from SemanticKITTI."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Box, Labels
from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.io.columns import readable
from lidaraccum.io.layouts import SEMANTIC_KITTI_LABELS
from lidaraccum.io.npy import arrays_of_npz

MOVING_CLASSES = range(251, 260)
"""SemanticKITTI's moving classes; 251 is the motion benchmark's "moving"."""
MOVABLE_CLASSES = (10, 11, 13, 15, 16, 18, 20, 30, 31, 32)
UNLABELLED_CLASSES = (0, 1)


def read_truth(
    folder: Path, kind: str, stem: str, world_from_sensor: rigid.Pose, boxes: tuple[Box, ...]
) -> Labels:
    """Labels of the frame called ``stem``, one for each row of its file.

    Raises:
        InputError: The labels are missing or damaged.
    """
    if kind == SEMANTIC_KITTI_LABELS:
        return semantic_kitti(folder / f"{stem}.label", world_from_sensor)
    return labels_of_npz(folder / f"{stem}.npz", world_from_sensor, boxes)


def semantic_kitti(path: Path, world_from_sensor: rigid.Pose) -> Labels:
    """One uint32 a point: low 16 bits the class, high 16 the instance."""
    with readable(path):
        size = path.stat().st_size
        if size % 4:
            raise InputError(f"{path} has {size} bytes, not a multiple of 4")
        words = np.fromfile(path, dtype="<u4")
    semantic = (words & 0xFFFF).astype(np.int32)
    dynamic = np.isin(semantic, MOVING_CLASSES)
    return Labels(
        world_from_sensor=world_from_sensor,
        foreground=dynamic | np.isin(semantic, MOVABLE_CLASSES),
        dynamic=dynamic,
        instance=(words >> 16).astype(np.int32),
        annotated=~np.isin(semantic, UNLABELLED_CLASSES),
        semantic=semantic,
    )


def labels_of_npz(path: Path, world_from_sensor: rigid.Pose, boxes: tuple[Box, ...]) -> Labels:
    """Arrays (N,) of the labelled layout; those that are missing say "none of it"."""
    arrays = arrays_of_npz(path)
    if not arrays:
        raise InputError(f"{path} holds no label")
    count = len(next(iter(arrays.values())))
    instance = np.asarray(arrays.get("instance", np.zeros(count)), dtype=np.int32)
    dynamic = np.asarray(arrays.get("dynamic", np.zeros(count)), dtype=np.bool_)
    foreground = arrays.get("foreground", dynamic | (instance > 0))
    annotated = arrays.get("annotated")
    return Labels(
        world_from_sensor=world_from_sensor,
        foreground=np.asarray(foreground, dtype=np.bool_),
        dynamic=dynamic,
        instance=instance,
        boxes=boxes,
        annotated=None if annotated is None else np.asarray(annotated, dtype=np.bool_),
        semantic=arrays.get("semantic"),
        points_at_stamp=arrays.get("points_at_stamp"),
    )


def label_fields(path: Path) -> tuple[str, ...]:
    """Names of the arrays in one file of labels."""
    return tuple(arrays_of_npz(path))


def rows_of_labels(labels: Labels, rows: NDArray[np.int64]) -> Labels:
    """The labels of the file's rows (M,) that became points."""
    places = labels.points_at_stamp
    return Labels(
        world_from_sensor=labels.world_from_sensor,
        foreground=labels.foreground[rows],
        dynamic=labels.dynamic[rows],
        instance=labels.instance[rows],
        boxes=labels.boxes,
        annotated=None if labels.annotated is None else labels.annotated[rows],
        semantic=None if labels.semantic is None else labels.semantic[rows],
        points_at_stamp=None if places is None else places[rows],
    )


def read_boxes(path: Path) -> dict[int, tuple[Box, ...]]:
    """Boxes of each frame, by the frame's index.

    Raises:
        InputError: Not the list that DESIGN.md's contract describes.
    """
    with readable(path):
        try:
            entries = json.loads(path.read_text())
            return {
                int(entry["frame"]): tuple(box_of(box) for box in entry["boxes"])
                for entry in entries
            }
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path} is not a list of boxes over frames: {error!r}") from error


def box_of(entry: Mapping[str, Any]) -> Box:
    """One box of boxes.json."""
    pose = np.array(entry["pose"], dtype=np.float64)
    if pose.shape != (4, 4):
        raise ValueError(f"a box's pose is 4 x 4, not {pose.shape}")
    length, width, height = (float(size) for size in entry["size_lwh"])
    return Box(
        id=int(entry["id"]),
        category=str(entry["category"]),
        size_lwh=(length, width, height),
        sensor_from_object=pose,
        speed_mps=float(entry["speed_mps"]),
        dynamic=bool(entry["dynamic"]),
    )
