"""An ordered drive: frames that are read when asked for, with or without the truth."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame, Labels


@runtime_checkable
class Sequence(Protocol):
    """Frames in order. Lazy: nothing of a frame is kept between two calls."""

    @property
    def name(self) -> str:
        """What the sequence is called in reports."""

    @property
    def rate_hz(self) -> float:
        """Frames a second."""

    @property
    def poses(self) -> NDArray[np.float64] | None:
        """(T, 4, 4) world_from_sensor that came with the frames, or None."""

    @property
    def crs_wkt(self) -> str | None:
        """Coordinate reference system of georeferenced frames as WKT, or None."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> Frame: ...


@runtime_checkable
class LabelledSequence(Sequence, Protocol):
    """A sequence that knows the truth about its points."""

    def labels(self, index: int, /) -> Labels:
        """The truth about frame ``index``, row by row with its points."""


@runtime_checkable
class OfSensor(Protocol):
    """A sequence that knows what took it."""

    @property
    def sensor(self) -> str:
        """Its name; empty where nobody says."""
