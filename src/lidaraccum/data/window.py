"""A few consecutive frames of a labelled drive, one of them the target."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame, Labels
from lidaraccum.data.sequence import LabelledSequence, OfSensor
from lidaraccum.errors import SettingsError

TARGETS = ("first", "middle", "last")
"""Which frame of a window the others are taken to; the paper takes the first."""


class Window:
    """T consecutive frames of a labelled sequence, itself a labelled sequence.

    Unlike a sequence it keeps what it has read: a window is small and looked at more than once.
    """

    def __init__(
        self,
        sequence: LabelledSequence,
        start: int,
        length: int,
        target: str = "first",
        poses: NDArray[np.float64] | None = None,
    ) -> None:
        """Open a window.

        Args:
            sequence: Where the frames come from.
            start: Index of the window's first frame in it.
            length: Frames, T, at least two.
            target: One of `TARGETS`.
            poses: (T, 4, 4) world_from_sensor that the window claims came with its frames.

        Raises:
            SettingsError: The window does not fit, or there is no such target.
        """
        if length < 2 or not 0 <= start <= len(sequence) - length:
            raise SettingsError(
                f"a window of {length} frames from frame {start} on does not fit into "
                f"{len(sequence)} frames"
            )
        if target not in TARGETS:
            raise SettingsError(f"there is no target {target!r}", hint=f"one of {TARGETS}")
        self._sequence = sequence
        self._length = length
        self._frames: dict[int, Frame] = {}
        self._labels: dict[int, Labels] = {}
        self.start = start
        self.target = {"first": 0, "middle": length // 2, "last": length - 1}[target]
        self.poses = poses

    @property
    def name(self) -> str:
        """The sequence's name and the frames in it."""
        return f"{self._sequence.name}[{self.start}:{self.start + self._length}]"

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return self._sequence.rate_hz

    @property
    def crs_wkt(self) -> str | None:
        """The sequence's coordinate reference system, or None."""
        return self._sequence.crs_wkt

    @property
    def sensor(self) -> str:
        """What took the sequence; empty where it does not say."""
        return self._sequence.sensor if isinstance(self._sequence, OfSensor) else ""

    @property
    def true_poses(self) -> NDArray[np.float64]:
        """(T, 4, 4) world_from_sensor by the labels."""
        return np.stack([self.labels(index).world_from_sensor for index in range(len(self))])

    def with_poses(self, poses: NDArray[np.float64] | None) -> Window:
        """The same window, claiming other poses (T, 4, 4); what has been read is shared."""
        twin = Window(self._sequence, self.start, self._length)
        twin.target, twin.poses = self.target, poses
        twin._frames, twin._labels = self._frames, self._labels
        return twin

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int, /) -> Frame:
        place = self._place(index)
        if place not in self._frames:
            self._frames[place] = self._sequence[self.start + place]
        return self._frames[place]

    def labels(self, index: int, /) -> Labels:
        """The truth about frame ``index`` of the window."""
        place = self._place(index)
        if place not in self._labels:
            # A simulated frame comes with its labels: ask for both while they are at hand.
            self[place]
            self._labels[place] = self._sequence.labels(self.start + place)
        return self._labels[place]

    def _place(self, index: int) -> int:
        if not -self._length <= index < self._length:
            raise IndexError(f"frame {index} of a window of {self._length}")
        return index % self._length


def windows(
    sequence: LabelledSequence, length: int, stride: int, target: str = "first"
) -> Iterator[Window]:
    """Every window of ``length`` frames, a start each ``stride`` frames; none when too short."""
    if stride < 1:
        raise SettingsError(f"a stride is 1 or more, not {stride}")
    for start in range(0, len(sequence) - length + 1, stride):
        yield Window(sequence, start, length, target)
