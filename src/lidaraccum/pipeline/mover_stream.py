"""Frames in, frames with their movers out: windows are searched as frames come by."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.pipeline.advice import Advice
from lidaraccum.pipeline.association import Association
from lidaraccum.pipeline.courses import are_alike
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.object_ids import ObjectIds
from lidaraccum.pipeline.objects import WindowObject, saved_by
from lidaraccum.pipeline.painting import Canvas, paint_mover
from lidaraccum.pipeline.search import find_objects
from lidaraccum.pipeline.suspects import spread_out, whole_template

log = logging.getLogger(__name__)

MOST_MOVING = 0.3
MOST_MOVING_AS_ONE = 0.1
AS_ONE_MPS = 1.0
"""Where a pose is doubtful and more than this share of all obstacles of a window seems to move, it
is the pose that is wrong; where all of it, several things, moves as one, the second share."""

STANDS_CLEARLY = 0.2
MOVER_SHARE = 0.1
ASKED_POINTS = 300
FEWEST_ASKED = 60
"""But not where the rest does not go along with any of the movers that have so large a share of
what moves: on a busy motorway most of what stands out is traffic. Going as they do, the rest must
cost so much more than standing; so many of its points are asked at most, and at least."""


class MoverStream:
    """The frames in flight: waiting for their windows, then for the windows that confirm them.

    Args:
        settings: What counts as a mover.
        advice: Who proposes movers, besides free space.
        ids: Where the movers' ids come from.
    """

    def __init__(
        self, settings: MotionSettings, advice: Advice, ids: ObjectIds | None = None
    ) -> None:
        self._settings = settings
        self._advice = advice
        self._association = Association(settings, ids or ObjectIds())
        self._waiting: deque[SightedFrame] = deque()
        self._since_window = 0

    def run(self, frames: Iterable[SightedFrame]) -> Iterator[PerceivedFrame]:
        """Of frames that nobody has watched yet each once, in order, movers labelled and placed."""
        for frame in self._advice.seen(frames):
            yield from self._push(frame)
        if self._since_window and len(self._waiting) > 1:
            self._look()
        while self._waiting:
            yield self._release()

    def _push(self, frame: SightedFrame) -> Iterator[PerceivedFrame]:
        for other in list(self._waiting)[-(self._settings.window - 1) :]:
            frame.watch(other)
            other.watch(frame)
        self._waiting.append(frame)
        self._since_window += 1
        if len(self._waiting) < self._settings.window or not self._is_due():
            return
        self._look()
        while len(self._waiting) >= self._settings.window + self._settings.stride:
            yield self._release()

    def _is_due(self) -> bool:
        first = self._since_window == len(self._waiting)
        return first or self._since_window >= self._settings.stride

    def _look(self) -> None:
        window = list(self._waiting)[-self._settings.window :]
        expected = [track.expectation for track in self._association.tracks]
        leads = self._advice.look(window)
        found = find_objects(window, self._settings, expected, leads)
        if _is_pose_wrong(found, window, self._settings):
            found = []
        self._association.link(found, window)
        self._since_window = 0

    def _release(self) -> PerceivedFrame:
        frame = self._waiting.popleft()
        sure = [track for track in self._association.tracks if self._association.is_sure(track)]
        canvas = Canvas(frame)
        for track in sorted(sure, key=lambda track: -len(track.picked.get(frame.index, ()))):
            paint_mover(track, frame, canvas, self._settings.box_growth)
        for track in self._association.tracks:
            track.forget(frame.index)
        self._advice.name_still(frame, canvas)
        return canvas.perceived()


def _is_pose_wrong(
    found: Sequence[WindowObject], window: Sequence[SightedFrame], settings: MotionSettings
) -> bool:
    """Whether it is a doubtful pose, not the movers found, that makes things seem to move."""
    doubtful = [frame.index for frame in window if frame.registered.quality.doubts]
    if not doubtful:
        return False
    velocities = [one.velocity for one in found]
    as_one = all(are_alike(velocities[0], other, AS_ONE_MPS, 0.0) for other in velocities[1:])
    most = MOST_MOVING_AS_ONE if len(found) > 1 and as_one else MOST_MOVING
    moving = sum(one.size for one in found)
    if moving <= most * sum(len(frame.rows) for frame in window):
        return False
    large = [one for one in found if one.size > MOVER_SHARE * moving]
    if large and all(_rest_stands(one, found, window, settings) for one in large):
        return False
    log.warning(
        "nothing is called moving around frame %d: its pose is doubtful, and too much would be",
        doubtful[0],
    )
    return True


def _rest_stands(
    one: WindowObject,
    found: Sequence[WindowObject],
    window: Sequence[SightedFrame],
    settings: MotionSettings,
) -> bool:
    """Whether what seems to stand clearly does not go as one of the movers seems to."""
    frame = one.fullest(window)
    stands = (frame.met > 0) & (frame.through == 0)
    for mover in found:
        stands[mover.of(frame)] = False
    spread = spread_out(frame, np.flatnonzero(stands))
    if len(spread) < FEWEST_ASKED:
        return False
    template = whole_template(frame, spread[:: len(spread) // ASKED_POINTS + 1])
    saved = saved_by(template, one.velocity_at(frame.stamp), 0.0, window, settings)
    return saved < -STANDS_CLEARLY
