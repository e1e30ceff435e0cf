"""What the network says, as arrays: the numpy side of its door, free of torch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError


@dataclass(frozen=True, eq=False)
class FrameReading:
    """What the network says of one frame's N points, row by row.

    Points that it did not look at (off its grid, without return, surely background) have
    probabilities 0 and offset 0.

    Attributes:
        foreground: (N,) float32 probability: on something that can move.
        dynamic: (N,) float32 probability: on something that does move.
        offset: (N, 2) float32 metres, x and y of the world's axes, from where the point lies (the
            sensor's motion undone) to its object's centre in the target frame.
    """

    foreground: NDArray[np.float32]
    dynamic: NDArray[np.float32]
    offset: NDArray[np.float32]

    def __post_init__(self) -> None:
        count = len(self.foreground)
        if self.dynamic.shape != (count,) or self.offset.shape != (count, 2):
            raise InputError(
                f"a reading of {count} points has {self.dynamic.shape} dynamic and "
                f"{self.offset.shape} offset"
            )

    @classmethod
    def background(cls, count: int) -> FrameReading:
        """Of a frame of so many points that the network did not look at."""
        none = np.zeros(count, dtype=np.float32)
        return cls(none, none, np.zeros((count, 2), dtype=np.float32))


@dataclass(frozen=True, eq=False)
class WindowReading:
    """What the network says of T frames whose poses are known.

    Attributes:
        frames: T readings.
        target: Place of the target frame among them, the one that offsets point into.
        kept: What the network keeps to follow objects by; nobody else's business.
    """

    frames: tuple[FrameReading, ...]
    target: int
    kept: Any = None


@dataclass(frozen=True, eq=False)
class ObjectReading:
    """Motions that the network proposes for K objects of a window.

    Attributes:
        ids: (K,) int64, ascending: the caller's.
        anchor: (K,) int64 place of the frame each is taken to: the target, or the one nearest to
            it that shows the object.
        seen: (K, T) bool: the network saw it in that frame.
        target_from_aligned: (K, T, 4, 4) float64: from where the object lies in frame t, the
            sensor's motion undone, to where it is in its anchor frame; both in sensor coordinates
            of the target frame. The identity in the anchor frame and where it is not seen.
    """

    ids: NDArray[np.int64]
    anchor: NDArray[np.int64]
    seen: NDArray[np.bool_]
    target_from_aligned: NDArray[np.float64]
