"""Frames are read while the ones before them are worked on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from lidaraccum.data.frame import Frame
from lidaraccum.data.sequence import Sequence

FRAMES_AHEAD = 2


def read_ahead(sequence: Sequence) -> Iterator[Frame]:
    """Each frame in order, read in a thread of its own up to two frames ahead.

    What reading a frame raises is raised when it is that frame's turn.
    """
    waiting: deque[Future[Frame]] = deque()
    with ThreadPoolExecutor(max_workers=1) as reader:
        for index in range(len(sequence)):
            waiting.append(reader.submit(sequence.__getitem__, index))
            if len(waiting) > FRAMES_AHEAD:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
