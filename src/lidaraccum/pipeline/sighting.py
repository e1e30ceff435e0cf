"""Registered frames become sighted ones, here or in the process that registers them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.geometry.viewpoint import find_viewpoint
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import MotionSettings


class Sighter:
    """Makes sighted frames of one sequence; the first tells where in its frames the sensor is.

    Picklable: `Registrar` has it work in its process.

    Args:
        settings: What counts as an obstacle.
    """

    def __init__(self, settings: MotionSettings) -> None:
        self._settings = settings
        self._viewpoint: NDArray[np.float64] | None = None

    def __call__(self, registered: RegisteredFrame) -> SightedFrame:
        """The frame's obstacles and what its rays passed through; nobody has watched it yet."""
        if self._viewpoint is None:
            self._viewpoint = find_viewpoint(registered.frame.points)
        return SightedFrame(registered, self._settings, self._viewpoint)

    def all(self, frames: Iterable[RegisteredFrame]) -> Iterator[SightedFrame]:
        """Each of the frames in turn."""
        return map(self, frames)
