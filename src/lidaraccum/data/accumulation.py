"""The result: points of all frames in one reference frame, each with its class and object."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray
from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid

BACKGROUND, STILL, MOVING = 0, 1, 2
"""Point classes: background, movable but still, moving (faster than 0.5 m/s)."""


@dataclass(frozen=True, eq=False)
class ObjectTrack:
    """One object through the sequence.

    Attributes:
        instance: Its id, positive.
        reference_from_frame: For each frame it was seen in, by index: the motion (4, 4) that takes
            its points from that frame's sensor coordinates to its place in the reference frame.
        points: Points it has, all frames together.
        velocity: (3,) mean velocity over ground in reference axes, m/s.
        size_lwh: Length, width, height of its accumulated points, metres.
        confidence: 0..1.
        moving: Faster than 0.5 m/s at some time.
    """

    instance: int
    reference_from_frame: Mapping[int, rigid.Pose]
    points: int
    velocity: NDArray[np.float64]
    size_lwh: tuple[float, float, float]
    confidence: float
    moving: bool


@dataclass(frozen=True, eq=False)
class AccumulatedFrame:
    """One frame's share of the result, ready for a writer.

    Attributes:
        index: Place of the frame in the sequence, from 0.
        points: (M, 3) float64, metres, in the reference frame, large origins included.
        rows: (M,) int64: each point's row among the file's points.
        row_count: Points in the file, dropped ones included.
        label: (M,) uint8: `BACKGROUND`, `STILL` or `MOVING`.
        instance: (M,) int32, 0 for none.
        confidence: (M,) float32, 0..1, of the label.
        time: (M,) float64, seconds from the first frame's stamp.
        range_m: (M,) float32, metres from the sensor.
        stamp: Seconds, of the frame, as its source counts them.
        reference_from_sensor: (4, 4) pose of the sensor; takes the file's coordinates.
        attributes: What came with the points, (M,) each, ``intensity`` and ``ring`` among them.
        name: What the frame is called, usually its file's name.
    """

    index: int
    points: NDArray[np.float64]
    rows: NDArray[np.int64]
    row_count: int
    label: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float32]
    time: NDArray[np.float64]
    range_m: NDArray[np.float32]
    stamp: float
    reference_from_sensor: rigid.Pose
    attributes: Mapping[str, NDArray[Any]]
    name: str = ""

    def __post_init__(self) -> None:
        count = len(self.points)
        for name in ("rows", "label", "instance", "confidence", "time", "range_m"):
            if getattr(self, name).shape != (count,):
                raise InputError(f"{name} must be ({count},), not {getattr(self, name).shape}")

    def __len__(self) -> int:
        return len(self.points)

    def select(self, keep: BoolArray) -> AccumulatedFrame:
        """Only the points where ``keep`` (M,) is True."""
        if keep.all():
            return self
        return replace(
            self,
            points=self.points[keep],
            rows=self.rows[keep],
            label=self.label[keep],
            instance=self.instance[keep],
            confidence=self.confidence[keep],
            time=self.time[keep],
            range_m=self.range_m[keep],
            attributes={name: values[keep] for name, values in self.attributes.items()},
        )


@dataclass(frozen=True, eq=False)
class Accumulation:
    """A whole sequence in one reference frame, in memory.

    Attributes:
        positions: (N, 3) float64, metres, in the reference frame.
        frame: (N,) int32: index of the frame each point came from.
        label: (N,) uint8: `BACKGROUND`, `STILL` or `MOVING`.
        instance: (N,) int32, 0 for none; one id through the whole sequence.
        confidence: (N,) float32, 0..1, of the label.
        time: (N,) float64, seconds from the first frame's stamp.
        attributes: What came with the points, (N,) each.
        reference_from_sensor: (T, 4, 4) pose of each frame.
        objects: What was found to be an object, by instance.
    """

    positions: NDArray[np.float64]
    frame: NDArray[np.int32]
    label: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float32]
    time: NDArray[np.float64]
    attributes: Mapping[str, NDArray[Any]]
    reference_from_sensor: NDArray[np.float64]
    objects: Mapping[int, ObjectTrack]

    @classmethod
    def from_frames(
        cls, frames: Iterable[AccumulatedFrame], objects: Iterable[ObjectTrack] = ()
    ) -> Accumulation:
        """Put the frames' shares together, in order.

        Attributes that not every frame has are left out.
        """
        parts = list(frames)
        if not parts:
            raise InputError("an accumulation needs at least one frame")
        shared = set.intersection(*(set(part.attributes) for part in parts))
        return cls(
            positions=np.concatenate([part.points for part in parts]),
            frame=np.concatenate([np.full(len(part), part.index, np.int32) for part in parts]),
            label=np.concatenate([part.label for part in parts]),
            instance=np.concatenate([part.instance for part in parts]),
            confidence=np.concatenate([part.confidence for part in parts]),
            time=np.concatenate([part.time for part in parts]),
            attributes={
                name: np.concatenate([part.attributes[name] for part in parts])
                for name in parts[0].attributes
                if name in shared
            },
            reference_from_sensor=np.stack([part.reference_from_sensor for part in parts]),
            objects={track.instance: track for track in objects},
        )

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def static(self) -> NDArray[np.float64]:
        """(M, 3) positions of all that does not move: the clean map."""
        return self.positions[self.label != MOVING]

    def instance_points(self, instance: int) -> NDArray[np.float64]:
        """(M, 3) accumulated positions of one object."""
        return self.positions[self.instance == instance]

    def flow(self, frame: int) -> NDArray[np.float64]:
        """Scene flow (M, 3) of one frame's points, sensor coordinates to the reference frame."""
        mine = self.frame == frame
        positions, instance = self.positions[mine], self.instance[mine]
        order = np.unique(self.frame).tolist().index(frame)
        source = rigid.transform(rigid.invert(self.reference_from_sensor[order]), positions)
        for track in self.objects.values():
            motion = track.reference_from_frame.get(frame)
            if motion is not None:
                own = instance == track.instance
                source[own] = rigid.transform(rigid.invert(motion), positions[own])
        return positions - source
