"""The seam between what proposes movers and the geometry that verifies them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Protocol

from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.painting import Canvas
from lidaraccum.pipeline.suspects import Lead

Leads = Callable[[], Sequence[Lead]]
"""Tells what may move, the likeliest first; asked late, for it may still be being thought about."""


def no_leads() -> Sequence[Lead]:
    """Nothing."""
    return ()


class Advice(Protocol):
    """Proposes movers window by window, and names what is movable but stands."""

    def seen(self, frames: Iterable[SightedFrame]) -> Iterator[SightedFrame]:
        """Take the frames in and hand them on, in order; a few are taken in before."""

    def look(self, window: Sequence[SightedFrame]) -> Leads:
        """Begin to look at a window of frames that were seen; to be asked before the next."""

    def name_still(self, frame: SightedFrame, canvas: Canvas) -> None:
        """Paint what is movable but stands, once the frame's movers are painted; in order."""


class NoAdvice:
    """Nobody proposes anything: free space alone raises suspicion, nobody knows what stands."""

    def seen(self, frames: Iterable[SightedFrame]) -> Iterator[SightedFrame]:
        """The frames."""
        return iter(frames)

    def look(self, window: Sequence[SightedFrame]) -> Leads:
        """None."""
        return no_leads

    def name_still(self, frame: SightedFrame, canvas: Canvas) -> None:
        """Nothing."""
