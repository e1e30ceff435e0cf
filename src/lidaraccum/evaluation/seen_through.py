"""Motion labels from free space alone: a baseline that labels movers and leaves them smeared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import permutations

import numpy as np

from lidaraccum.data.accumulation import BACKGROUND, MOVING
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.pipeline.motion_settings import BALANCED, MotionSettings
from lidaraccum.pipeline.sighting import Sighter

LEAST_WITNESSES = 2
"""So many other frames saw through a point that moves, and more than saw something there."""


class SeenThrough:
    """Calls moving what other frames of the window saw through; told nothing, moves nothing.

    The principle of DUFOMap (Duberg et al., RA-L 2024), on range images in place of a voxel map.
    """

    def __init__(self, settings: MotionSettings = BALANCED) -> None:
        self._settings = settings

    def perceive(self, frames: Iterable[RegisteredFrame]) -> Iterator[PerceivedFrame]:
        """All frames at once: every one looks at every other."""
        sighted = list(Sighter(self._settings).all(frames))
        for one, other in permutations(sighted, 2):
            one.watch(other)
        least = min(LEAST_WITNESSES, len(sighted) - 1)
        for frame in sighted:
            moves = (frame.through >= least) & (frame.through > frame.met)
            count = len(frame.registered.frame)
            label = np.full(count, BACKGROUND, dtype=np.uint8)
            label[frame.rows[moves]] = MOVING
            yield PerceivedFrame(
                registered=frame.registered,
                label=label,
                instance=np.zeros(count, dtype=np.int32),
                confidence=np.ones(count, dtype=np.float32),
            )
