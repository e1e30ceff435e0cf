"""Each object's way through the sequence, gathered frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.accumulation import MOVING, AccumulatedFrame, ObjectTrack
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.geometry import rigid


@dataclass
class _Entry:
    """What is known of one object so far."""

    world_from_object: dict[int, rigid.Pose] = field(default_factory=dict)
    stamps: dict[int, float] = field(default_factory=dict)
    reference_from_frame: dict[int, rigid.Pose] = field(default_factory=dict)
    points: int = 0
    moving: bool = False
    confidence_sum: float = 0.0
    low: NDArray[np.float64] = field(default_factory=lambda: np.full(3, np.inf))
    high: NDArray[np.float64] = field(default_factory=lambda: np.full(3, -np.inf))
    axes: rigid.Pose = field(default_factory=lambda: np.eye(4))


class TrackBook:
    """Remembers where each mover was, so that its points can be taken to one place."""

    def __init__(self) -> None:
        self._entries: dict[int, _Entry] = {}

    def note(self, perceived: PerceivedFrame) -> None:
        """Remember the movers' poses in this frame."""
        registered = perceived.registered
        for instance, pose in perceived.world_from_object.items():
            entry = self._entries.setdefault(instance, _Entry())
            entry.world_from_object[registered.index] = pose
            entry.stamps[registered.index] = registered.frame.stamp

    def anchor_from_object(self, instance: int, reference: int) -> rigid.Pose:
        """The mover's pose (4, 4) in the world in the noted frame nearest to the reference."""
        seen = self._entries[instance].world_from_object
        return seen[min(seen, key=lambda index: abs(index - reference))]

    def count(
        self, frame: AccumulatedFrame, motions: dict[int, rigid.Pose], axes: dict[int, rigid.Pose]
    ) -> None:
        """Add a placed frame's points to their objects.

        Args:
            frame: The frame in the reference frame.
            motions: reference_from_frame (4, 4) of each mover, for the file's coordinates.
            axes: reference_from_object (4, 4) of each mover, to measure its size along.
        """
        owned = np.flatnonzero(frame.instance)
        if not len(owned):
            return
        owned = owned[np.argsort(frame.instance[owned], kind="stable")]
        ids, starts = np.unique(frame.instance[owned], return_index=True)
        for instance, rows in zip(ids.tolist(), np.split(owned, starts[1:]), strict=True):
            entry = self._entries.setdefault(instance, _Entry())
            entry.reference_from_frame[frame.index] = motions.get(
                instance, frame.reference_from_sensor
            )
            if instance in axes:
                entry.axes = axes[instance]
            entry.points += len(rows)
            entry.moving |= bool((frame.label[rows] == MOVING).any())
            entry.confidence_sum += float(frame.confidence[rows].sum())
            own = rigid.transform(rigid.invert(entry.axes), frame.points[rows])
            entry.low = np.minimum(entry.low, own.min(axis=0))
            entry.high = np.maximum(entry.high, own.max(axis=0))

    def tracks(self, reference_from_world: rigid.Pose) -> list[ObjectTrack]:
        """Every object that has points, by instance."""
        return [
            ObjectTrack(
                instance=instance,
                reference_from_frame=entry.reference_from_frame,
                points=entry.points,
                velocity=reference_from_world[:3, :3] @ _mean_velocity(entry),
                size_lwh=_size(entry),
                confidence=entry.confidence_sum / entry.points,
                moving=entry.moving,
            )
            for instance, entry in sorted(self._entries.items())
            if entry.points
        ]


def _size(entry: _Entry) -> tuple[float, float, float]:
    length, width, height = (entry.high - entry.low).tolist()
    return (length, width, height)


def _mean_velocity(entry: _Entry) -> NDArray[np.float64]:
    if len(entry.stamps) < 2:
        return np.zeros(3)
    first, last = min(entry.stamps), max(entry.stamps)
    seconds = entry.stamps[last] - entry.stamps[first]
    if seconds <= 0:
        return np.zeros(3)
    way = entry.world_from_object[last][:3, 3] - entry.world_from_object[first][:3, 3]
    return way / seconds
