"""Where every point of a window truly belongs, and which points are scored."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray, Frame, Labels
from lidaraccum.data.window import Window
from lidaraccum.errors import SettingsError
from lidaraccum.evaluation.categories import point_categories
from lidaraccum.geometry import rigid
from lidaraccum.geometry.terrain import estimate_terrain
from lidaraccum.metrics.flow import SQUARE_HALF_WIDTH_M, inside_square


@dataclass(frozen=True)
class Scope:
    """Which points are scored.

    Attributes:
        half_width_m: Of the square about the sensor in the target frame; 0 scores everywhere.
        above_ground_m: Height above the frame's estimated ground from which on points are scored;
            0 scores the ground too. The paper leaves ground out.
    """

    half_width_m: float = SQUARE_HALF_WIDTH_M
    above_ground_m: float = 0.0

    def __post_init__(self) -> None:
        if min(self.half_width_m, self.above_ground_m) < 0:
            raise SettingsError("half width and height above ground must not be negative")


@dataclass(frozen=True, eq=False)
class FrameTruth:
    """The truth about one frame's N points, seen from the window's target frame.

    Attributes:
        at_stamp: (N, 3) float64 metres: where each was at the frame's stamp, in the frame's own
            coordinates.
        in_target: (N, 3) float64 metres: where it belongs, in the target frame's coordinates. For
            points that are not ``known``: where they would belong if they stood still.
        known: (N,) bool: the truth knows where they belong.
        scored: (N,) bool: annotated, in the scope, and an echo of something.
        dynamic: (N,) bool.
        foreground: (N,) bool.
        instance: (N,) int32, 0 for none.
        category: (N,) int, index in `categories.CATEGORIES`.
        speed_mps: (N,) of the box that each is on, by the labels; 0 on none.
        way_m: (N,) metres it goes over ground from the frame's stamp to the target's, 0 where it
            stands or is not known.
    """

    at_stamp: NDArray[np.float64]
    in_target: NDArray[np.float64]
    known: BoolArray
    scored: BoolArray
    dynamic: BoolArray
    foreground: BoolArray
    instance: NDArray[np.int32]
    category: NDArray[np.int64]
    speed_mps: NDArray[np.float64]
    way_m: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WindowTruth:
    """The truth about a window.

    Attributes:
        frames: T frames.
        movers: Instances that are dynamic in any frame of the window.
        poses: (T, 4, 4) target_from_sensor.
    """

    frames: tuple[FrameTruth, ...]
    movers: frozenset[int]
    poses: NDArray[np.float64]


def window_truth(window: Window, scope: Scope) -> WindowTruth:
    """Work out where the points of a window belong.

    What is dynamic in any frame of the window follows its boxes from frame to frame, whatever its
    speed in one of them; all else stands still, so that jitter in the boxes of parked cars is not
    taken for motion. A mover without a point in the target frame, or without a box in one of the
    two frames, belongs nowhere known: the method takes it to another frame (the paper,
    supplement), and there is nothing to compare with.

    Args:
        window: Labelled frames.
        scope: Which of its points are scored.
    """
    labels = [window.labels(index) for index in range(len(window))]
    movers = frozenset[int]().union(*(_dynamic_instances(one) for one in labels))
    target = labels[window.target]
    places = _boxes(target)
    seen = np.unique(target.instance).tolist()
    anchors = {instance: places[instance] for instance in movers & set(seen) & set(places)}
    poses = rigid.invert(target.world_from_sensor) @ window.true_poses
    frames = [
        _frame_truth(frame, one, pose, movers, anchors, scope)
        for frame, one, pose in zip(window, labels, poses, strict=True)
    ]
    return WindowTruth(tuple(frames), movers, poses)


def _frame_truth(
    frame: Frame,
    labels: Labels,
    target_from_sensor: rigid.Pose,
    movers: frozenset[int],
    anchors: dict[int, rigid.Pose],
    scope: Scope,
) -> FrameTruth:
    places = frame.points if labels.points_at_stamp is None else labels.points_at_stamp
    at_stamp = np.asarray(places, dtype=np.float64) + frame.origin
    standing = rigid.transform(target_from_sensor, at_stamp)
    in_target = standing.copy()
    known = ~np.isin(labels.instance, list(movers)) & ~labels.dynamic
    boxes = _boxes(labels)
    for instance, target_from_object in anchors.items():
        own = labels.instance == instance
        if instance in boxes and own.any():
            motion = target_from_object @ rigid.invert(boxes[instance])
            in_target[own] = rigid.transform(motion, at_stamp[own])
            known |= own
    scored = frame.returned.copy()
    if labels.annotated is not None:
        scored &= labels.annotated
    if scope.half_width_m:
        scored &= inside_square(in_target, scope.half_width_m)
    if scope.above_ground_m:
        heights = estimate_terrain(frame.points).height_above(frame.points)
        scored &= heights >= scope.above_ground_m
    return FrameTruth(
        at_stamp=at_stamp,
        in_target=in_target,
        known=known,
        scored=scored,
        dynamic=labels.dynamic,
        foreground=labels.foreground,
        instance=labels.instance,
        category=point_categories(labels),
        speed_mps=_speeds(labels),
        way_m=np.linalg.norm(in_target - standing, axis=1),
    )


def _dynamic_instances(labels: Labels) -> set[int]:
    boxed = {box.id for box in labels.boxes if box.dynamic}
    return (boxed | set(np.unique(labels.instance[labels.dynamic]).tolist())) - {0}


def _speeds(labels: Labels) -> NDArray[np.float64]:
    speeds = np.zeros(len(labels.instance))
    for box in labels.boxes:
        speeds[labels.instance == box.id] = box.speed_mps
    return speeds


def _boxes(labels: Labels) -> dict[int, rigid.Pose]:
    return {box.id: box.sensor_from_object for box in labels.boxes}
