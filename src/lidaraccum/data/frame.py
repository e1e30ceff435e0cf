"""What a sensor delivers: frames of points, and, apart from them, the truth about the points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.floating[Any]]
IntArray = NDArray[np.integer[Any]]

NO_RETURN_RANGE_M = 0.01
"""Points nearer to the sensor than this are echoes that never came back, written as zeros."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One sweep of the sensor.

    Attributes:
        points: (N, 3) float32, metres, sensor coordinates less ``origin``. All finite.
        stamp: Reference time of the frame in seconds; ``points`` without motion compensation are
            each measured at ``stamp + time_offset``.
        intensity: (N,) as delivered, any real type, or None.
        time_offset: (N,) seconds from ``stamp``, or None when the file has no time per point.
        ring: (N,) integer beam index, or None.
        attributes: Everything else that came with the points, (N,) each, by the file's name.
        origin: (3,) float64, metres: what was subtracted from the file's coordinates; zero unless
            they were too large for float32 (georeferenced frames).
        name: What the frame is called in messages, usually its file's name.
        rows: (N,) int64: each point's row in the file; None when no point was dropped.
        row_count: Points in the file, dropped (non-finite) ones included.
    """

    points: NDArray[np.float32]
    stamp: float = 0.0
    intensity: NDArray[Any] | None = None
    time_offset: FloatArray | None = None
    ring: IntArray | None = None
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    name: str = ""
    rows: NDArray[np.int64] | None = None
    row_count: int = -1

    def __post_init__(self) -> None:
        points = np.asarray(self.points)
        if points.dtype != np.float32 or points.ndim != 2 or points.shape[1] != 3:
            raise InputError(f"points must be (N, 3) float32, not {points.shape} {points.dtype}")
        if not np.isfinite(points).all():
            raise InputError(f"frame {self.name or self.stamp} holds non-finite points")
        columns = {
            "intensity": self.intensity,
            "time_offset": self.time_offset,
            "ring": self.ring,
            "rows": self.rows,
            **self.attributes,
        }
        for name, values in columns.items():
            if values is not None and values.shape != (len(points),):
                raise InputError(f"{name} must be ({len(points)},), not {values.shape}")
        object.__setattr__(self, "attributes", dict(self.attributes))
        object.__setattr__(self, "origin", np.asarray(self.origin, dtype=np.float64))
        if self.row_count < 0:
            object.__setattr__(self, "row_count", len(points))

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def returned(self) -> BoolArray:
        """(N,) bool: False for "no return" points, which lie at the sensor's own place."""
        if self.origin.any():
            return np.any(np.abs(self.points + self.origin) >= NO_RETURN_RANGE_M, axis=1)
        away = np.abs(self.points) >= NO_RETURN_RANGE_M
        return away[:, 0] | away[:, 1] | away[:, 2]

    @property
    def ranges(self) -> NDArray[np.float32]:
        """(N,) distance from the sensor, metres; infinite where float32 cannot hold it."""
        x, y, z = self.points.T
        with np.errstate(over="ignore"):
            return np.asarray(np.sqrt(x * x + y * y + z * z))

    def with_points(self, points: FloatArray) -> Frame:
        """The same frame with its points elsewhere (deskewed, say): (N, 3), metres."""
        return replace(self, points=np.asarray(points, dtype=np.float32))


@dataclass(frozen=True, eq=False)
class Box:
    """One tracked object in one frame.

    Attributes:
        id: Positive, stable over the sequence; the ``instance`` of its points.
        category: The data set's word: Car, Cyclist, Pedestrian, ...
        size_lwh: Length, width, height in metres.
        sensor_from_object: (4, 4): the box's centre and heading in that frame's sensor coordinates.
        speed_mps: Speed over ground.
        dynamic: Faster than 0.5 m/s.
    """

    id: int
    category: str
    size_lwh: tuple[float, float, float]
    sensor_from_object: NDArray[np.float64]
    speed_mps: float
    dynamic: bool


@dataclass(frozen=True, eq=False)
class Labels:
    """The truth about one frame.

    Attributes:
        world_from_sensor: (4, 4) pose at the frame's stamp.
        foreground: (N,) bool: on something that can move.
        dynamic: (N,) bool: on something that does move, faster than 0.5 m/s.
        instance: (N,) int32, 0 for background, stable over the sequence.
        boxes: The frame's objects.
        annotated: (N,) bool: only such points are scored; None when all are.
        semantic: (N,) class index of the data set, or None.
        points_at_stamp: (N, 3) metres: where each point was at the frame's stamp, in sensor
            coordinates then, movers moved too; None where the frame's own points say it.
    """

    world_from_sensor: NDArray[np.float64]
    foreground: BoolArray
    dynamic: BoolArray
    instance: NDArray[np.int32]
    boxes: tuple[Box, ...] = ()
    annotated: BoolArray | None = None
    semantic: IntArray | None = None
    points_at_stamp: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.world_from_sensor.shape != (4, 4):
            raise InputError(f"a pose is (4, 4), not {self.world_from_sensor.shape}")
        count = len(self.foreground)
        for name in ("dynamic", "instance", "annotated", "semantic"):
            values = getattr(self, name)
            if values is not None and values.shape != (count,):
                raise InputError(f"labels disagree: {name} is {values.shape}, not ({count},)")
        places = self.points_at_stamp
        if places is not None and places.shape != (count, 3):
            raise InputError(f"labels disagree: {places.shape} points_at_stamp for {count} points")

    @property
    def world_from_object(self) -> dict[int, NDArray[np.float64]]:
        """Pose (4, 4) of each object of the frame, by instance."""
        return {box.id: self.world_from_sensor @ box.sensor_from_object for box in self.boxes}
