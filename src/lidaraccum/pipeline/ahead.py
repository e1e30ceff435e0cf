"""Items are made while the ones before them are worked on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

Item = TypeVar("Item")

FRAMES_AHEAD = 4
"""Movers are looked for every four frames: meanwhile the next four can be made ready."""


def ahead(items: Iterable[Item]) -> Iterator[Item]:
    """Each item in order, made in a thread of its own up to `FRAMES_AHEAD` items ahead.

    What making an item raises is raised when it is that item's turn.
    """
    source = iter(items)
    waiting: deque[Future[list[Item]]] = deque()
    with ThreadPoolExecutor(max_workers=1) as maker:
        waiting.extend(maker.submit(_next, source) for _ in range(FRAMES_AHEAD))
        try:
            while made := waiting.popleft().result():
                waiting.append(maker.submit(_next, source))
                yield made[0]
        finally:
            for one in waiting:
                one.cancel()


def _next(source: Iterator[Item]) -> list[Item]:
    """The next item alone; none when there is no more, for a future holds no StopIteration."""
    return list(islice(source, 1))
