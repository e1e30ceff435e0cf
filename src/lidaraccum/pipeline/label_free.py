"""Movers found from geometry alone: no network, no labels, any sensor."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.pipeline.advice import NoAdvice
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import BALANCED, MotionSettings
from lidaraccum.pipeline.mover_stream import MoverStream
from lidaraccum.pipeline.sighting import Sighter


class LabelFree:
    """Finds movers by free-space evidence and motions that explain the points better than none.

    Looks ahead a window and a stride; memory and time do not grow with the sequence. What is
    movable but has never moved is background: there is nobody here to know.
    """

    def __init__(self, settings: MotionSettings = BALANCED) -> None:
        self.settings = settings

    def perceive(self, frames: Iterable[RegisteredFrame]) -> Iterator[PerceivedFrame]:
        """Each frame once, in order, its movers labelled and placed."""
        return self.perceive_sighted(Sighter(self.settings).all(frames))

    def perceive_sighted(self, frames: Iterable[SightedFrame]) -> Iterator[PerceivedFrame]:
        """As `perceive`, of frames that a `Sighter` of the same settings has sighted."""
        return MoverStream(self.settings, NoAdvice()).run(frames)
