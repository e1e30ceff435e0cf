"""The network's proposals to the stream: frames encoded once, looked at together, not believed."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.clustering import dense_groups
from lidaraccum.model.reading import FrameReading
from lidaraccum.pipeline.advice import Leads
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.leaves import Leaves
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.object_ids import ObjectIds
from lidaraccum.pipeline.painting import Canvas
from lidaraccum.pipeline.places import Places
from lidaraccum.pipeline.still_objects import StillObjects
from lidaraccum.pipeline.suspects import Lead
from lidaraccum.pipeline.tubes import CELL_M, NEIGHBOURS, RADIUS_M, Reader, Tube, find_tubes

SPAN = 5
"""Frames that the network looks at together: the windows it learned on, the first the target."""

MOVABLE_ABOVE = 0.5
"""Points whose probability of being on something movable is higher are."""

SURE_ABOVE = 0.93
"""What is movable with a mean probability above this need not be smooth: a trailer may be full of
branches. Nor need what touches the carrier, whose own parts are rough."""

STILL_POINTS = 10
"""What stands has so many points in a frame, low ones among them, that are not so close that they
may be the carrier's. Those which are join the others: the carrier has none but them."""


class NetworkAdvice:
    """Proposes what the network takes for moving; names what it takes for movable and stands.

    Args:
        reader: The network.
        settings: What counts as a mover.
        ids: Where the ids of what stands come from.
        worker: Looks at a window while free space is asked, then encodes the frames of the next
            while the movers of this one are found and painted. One thing after another; what it
            raises is raised when leads are asked for.
    """

    def __init__(
        self, reader: Reader, settings: MotionSettings, ids: ObjectIds, worker: Executor
    ) -> None:
        self._reader = reader
        self._worker = worker
        self._settings = settings
        self._still = StillObjects(ids)
        self._leaves = Leaves()
        self._places = Places()
        self._unsent: list[SightedFrame] = []
        self._encoded: dict[int, Future[Any]] = {}
        self._readings: dict[int, FrameReading] = {}
        self._tubes: list[Tube] = []
        self._next_unread = 0

    def seen(self, frames: Iterable[SightedFrame]) -> Iterator[SightedFrame]:
        """Have the frames encoded: those of the next window while one is searched."""
        waiting: deque[SightedFrame] = deque()
        for frame in frames:
            waiting.append(frame)
            self._unsent.append(frame)
            is_before_first_window = self._next_unread == 0
            if is_before_first_window:
                self._encode()
            if len(waiting) > self._settings.stride:
                yield waiting.popleft()
        yield from waiting

    def look(self, window: Sequence[SightedFrame]) -> Leads:
        """Have the window looked at, all of whose frames were given to be encoded by `seen`."""
        runs = list(self._unread_runs(window))
        encoded = [[self._encoded[frame.index] for frame in run] for run in runs]
        oldest = window[-SPAN:][0].index
        self._encoded = {index: one for index, one in self._encoded.items() if index >= oldest}
        self._next_unread = window[-1].index + 1
        looking = self._worker.submit(self._leads, window, runs, encoded)
        self._encode()
        return looking.result

    def _encode(self) -> None:
        """Have the worker encode what it was not given yet."""
        for frame in self._unsent:
            encoded = self._worker.submit(self._reader.read, frame.registered.frame)
            self._encoded[frame.index] = encoded
        self._unsent.clear()

    def _leads(
        self,
        window: Sequence[SightedFrame],
        runs: Sequence[Sequence[SightedFrame]],
        encoded: Sequence[Sequence[Future[Any]]],
    ) -> list[Lead]:
        """What the network sees moving in the runs, where the window shows it, largest first."""
        for run, kept in zip(runs, encoded, strict=True):
            poses = np.stack([frame.world_from_sensor for frame in run])
            reading = self._reader.look([one.result() for one in kept], poses, 0)
            for frame, one in zip(run, reading.frames, strict=True):
                self._note(frame, one)
            self._tubes += find_tubes(run, reading, self._reader, self._settings)
        shown = {frame.index for frame in window}
        self._tubes = [tube for tube in self._tubes if shown & tube.picked.keys()]
        leads = [tube.lead(window) for tube in self._tubes]
        return sorted((one for one in leads if one), key=lambda lead: -len(lead.suspect))

    def name_still(self, frame: SightedFrame, canvas: Canvas) -> None:
        """Movable points that no mover has become objects that stand, unless they are leaves."""
        reading = self._readings.pop(frame.index, None)
        if reading is None:
            return
        rows, level = _standing(frame)
        moving = self._follow_movers(rows, level, canvas)
        movable = self._places.probability(level)
        free = (movable > MOVABLE_ABOVE) & (canvas.instances(rows) == 0)
        rows, level, movable = rows[free], level[free], movable[free]
        cluster = dense_groups(level + reading.offset[rows], CELL_M, RADIUS_M, NEIGHBOURS)
        apart = ~np.isin(rows, frame.close_rows)
        told = (cluster >= 0) & apart
        counts = np.bincount(cluster[told], minlength=int(cluster.max(initial=0)) + 1)
        groups = [np.flatnonzero(cluster == one) for one in np.flatnonzero(counts >= STILL_POINTS)]
        names = self._still.name([level[group] for group in groups], moving)
        points = frame.registered.frame.points
        for name, group in zip(names, groups, strict=True):
            judged = apart[group].all() and movable[group].mean() < SURE_ABOVE
            if not (judged and self._leaves.are_all_of(name, points[rows[group]])):
                canvas.paint_still(rows[group], name, movable[group])

    def _unread_runs(self, window: Sequence[SightedFrame]) -> Iterator[list[SightedFrame]]:
        """Runs of frames that cover all that was not looked at, each from the one before on."""
        unread = next(
            (p for p, frame in enumerate(window) if frame.index >= self._next_unread), len(window)
        )
        while unread < len(window):
            first = max(0, min(unread - 1, len(window) - SPAN))
            yield list(window[first : first + SPAN])
            unread = first + SPAN

    def _note(self, frame: SightedFrame, reading: FrameReading) -> None:
        """Keep what was read of a frame; a frame looked at again speaks for a place once more."""
        self._readings[frame.index] = reading
        rows, level = _standing(frame)
        ranges = frame.registered.frame.ranges[rows]
        self._places.note(level, reading.foreground[rows], ranges)

    def _follow_movers(
        self, rows: NDArray[np.int64], level: NDArray[np.float64], canvas: Canvas
    ) -> set[int]:
        """Takes the places of the frame's movers along; their ids."""
        instances = canvas.instances(rows)
        moving = instances > 0
        instances, level = instances[moving], level[moving]
        names = set(np.unique(instances).tolist())
        for instance in sorted(names):
            self._still.follow(instance, level[instances == instance])
        return names


def _standing(frame: SightedFrame) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Rows (K,) of what stands on the ground, the carrier perhaps among it, and places (K, 2)."""
    rows = np.concatenate([frame.rows, frame.low_rows, frame.close_rows])
    return rows, np.concatenate([frame.near_world, frame.close_world])[:, :2]
