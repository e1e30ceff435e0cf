"""The seam between what proposes movers and the geometry that verifies them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.painting import Canvas
from lidaraccum.pipeline.suspects import Lead


class Advice(Protocol):
    """Proposes movers window by window, and names what is movable but stands."""

    def see(self, frame: SightedFrame) -> None:
        """Take in the next frame."""

    def leads(self, window: Sequence[SightedFrame]) -> list[Lead]:
        """What may move in a window of frames that were seen, the likeliest first."""

    def name_still(self, frame: SightedFrame, canvas: Canvas) -> None:
        """Paint what is movable but stands, once the frame's movers are painted; in order."""


class NoAdvice:
    """Nobody proposes anything: free space alone raises suspicion, nobody knows what stands."""

    def see(self, frame: SightedFrame) -> None:
        """Nothing."""

    def leads(self, window: Sequence[SightedFrame]) -> list[Lead]:
        """None."""
        return []

    def name_still(self, frame: SightedFrame, canvas: Canvas) -> None:
        """Nothing."""
