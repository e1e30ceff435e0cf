"""From boxes to points: what lies in a box is of its object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray, Box, Labels
from lidaraccum.geometry import rigid
from lidaraccum.io.driving.tracks import Sighting

DYNAMIC_MPS = 0.5
"""What moves faster is dynamic (the paper, section 5.1)."""

EDGE_M = 1e-4
"""Points this far outside count as inside: boxes and points are rounded."""


@dataclass(frozen=True, eq=False)
class Sighted:
    """One object of one frame.

    Attributes:
        id: Its instance, positive, stable over the sequence.
        category: The data set's word.
        sighting: Where it is.
    """

    id: int
    category: str
    sighting: Sighting


def label(
    points: NDArray[np.float32],
    world_from_sensor: rigid.Pose,
    objects: tuple[Sighted, ...],
    scored: BoolArray | None = None,
) -> Labels:
    """The truth about a frame, read off its boxes.

    A point in several boxes is of the smallest; one of a certain box comes before any other. Boxes
    that are not certain label their points all the same, so that they count neither as background
    nor as still, but these points are not annotated and the box is not listed.

    Args:
        points: (N, 3) metres, sensor coordinates.
        world_from_sensor: (4, 4).
        objects: All movable objects about.
        scored: (N,) False for points about which the data set knows nothing; None: it knows of all.
    """
    places = SortedPoints(points)
    owner = np.zeros(len(points), dtype=np.int32)
    annotated = np.ones(len(points), dtype=np.bool_) if scored is None else scored.copy()
    dynamic = np.zeros(len(points), dtype=np.bool_)
    boxes = {one.id: box_of(one, world_from_sensor) for one in objects}
    for one in sorted(objects, key=_last_wins):
        box = boxes[one.id]
        own = places.inside(box.sensor_from_object, np.array(box.size_lwh))
        owner[own] = one.id
        dynamic[own] = box.dynamic
        annotated[own] = one.sighting.certain and (True if scored is None else scored[own])
    return Labels(
        world_from_sensor=world_from_sensor,
        foreground=owner > 0,
        dynamic=dynamic,
        instance=owner,
        boxes=tuple(boxes[one.id] for one in objects if one.sighting.certain),
        annotated=annotated,
    )


def box_of(one: Sighted, world_from_sensor: rigid.Pose) -> Box:
    """The object's box in the frame's sensor coordinates."""
    sighting = one.sighting
    length, width, height = sighting.size_lwh.tolist()
    return Box(
        one.id,
        one.category,
        (length, width, height),
        rigid.invert(world_from_sensor) @ sighting.world_from_object,
        sighting.speed_mps,
        sighting.speed_mps > DYNAMIC_MPS,
    )


def _last_wins(one: Sighted) -> tuple[bool, float]:
    return one.sighting.certain, -float(np.prod(one.sighting.size_lwh))


class SortedPoints:
    """Points by their x, so that a box asks only those beside it.

    Args:
        points: (N, 3) metres.
    """

    def __init__(self, points: NDArray[np.float32]) -> None:
        self._points = points
        self._order = np.argsort(points[:, 0], kind="stable")
        self._x = points[self._order, 0]

    def inside(self, frame_from_box: rigid.Pose, size_lwh: NDArray[np.float64]) -> NDArray[np.intp]:
        """Rows (M,) of the points inside a box, its faces included."""
        half = size_lwh / 2 + EDGE_M
        reach = float(np.linalg.norm(half))
        middle = frame_from_box[0, 3]
        low, high = np.searchsorted(self._x, [middle - reach, middle + reach])
        beside = self._order[low:high]
        local = rigid.transform(rigid.invert(frame_from_box), self._points[beside])
        return beside[(np.abs(local) <= half).all(axis=1)]
