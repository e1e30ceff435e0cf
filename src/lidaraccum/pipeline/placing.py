"""From perceived frames to points in the reference frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.accumulation import AccumulatedFrame
from lidaraccum.data.frame import Frame
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.geometry import rigid
from lidaraccum.pipeline.tracks import TrackBook


class Reference:
    """The frame that all points are taken to.

    Args:
        index: Its place in the sequence: movers are shown where they were nearest to its time.
        reference_from_world: (4, 4) into its sensor coordinates (or identity: the world's own).
        origin: (3,) metres, added to every position: the large part of its coordinates.
        start: Stamp of the first frame, seconds.
    """

    def __init__(
        self,
        index: int,
        reference_from_world: rigid.Pose,
        origin: NDArray[np.float64],
        start: float,
    ) -> None:
        self.index = index
        self.reference_from_world = rigid.translation(origin) @ reference_from_world
        self._start = start

    def place(self, perceived: PerceivedFrame, book: TrackBook) -> AccumulatedFrame:
        """The frame's points where they belong, each mover at its place nearest the reference.

        What the frame adds to each object is noted in the book.
        """
        registered, frame = perceived.registered, perceived.registered.frame
        reference_from_sensor = self.reference_from_world @ registered.world_from_sensor
        points = rigid.transform(reference_from_sensor, frame.points)
        file_from_local = rigid.translation(frame.origin)
        motions: dict[int, rigid.Pose] = {}
        axes: dict[int, rigid.Pose] = {}
        for instance, world_from_object in perceived.world_from_object.items():
            own = perceived.instance == instance
            if not own.any():
                continue
            anchor = book.anchor_from_object(instance, self.index)
            axes[instance] = self.reference_from_world @ anchor
            object_from_sensor = rigid.invert(world_from_object) @ registered.world_from_sensor
            motion = axes[instance] @ object_from_sensor
            points[own] = rigid.transform(motion, frame.points[own])
            motions[instance] = motion @ rigid.invert(file_from_local)
        placed = AccumulatedFrame(
            index=registered.index,
            points=points,
            rows=np.arange(len(frame)) if frame.rows is None else frame.rows,
            row_count=frame.row_count,
            label=perceived.label,
            instance=perceived.instance,
            confidence=perceived.confidence,
            time=_seconds(frame, self._start),
            range_m=frame.ranges,
            stamp=frame.stamp,
            reference_from_sensor=reference_from_sensor @ rigid.invert(file_from_local),
            attributes=_columns(frame),
            name=frame.name,
        )
        book.count(placed, motions, axes)
        return placed


def _seconds(frame: Frame, start: float) -> NDArray[np.float64]:
    """When each point was measured, seconds after the start; the frame's stamp where unknown."""
    time = np.full(len(frame), frame.stamp - start)
    return time if frame.time_offset is None else time + frame.time_offset


def _columns(frame: Frame) -> dict[str, NDArray[Any]]:
    columns: dict[str, NDArray[Any]] = {}
    if frame.intensity is not None:
        columns["intensity"] = frame.intensity
    if frame.ring is not None:
        columns["ring"] = frame.ring
    return columns | dict(frame.attributes)
