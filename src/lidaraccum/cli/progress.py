"""A progress bar on a terminal, nothing anywhere else."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

Item = TypeVar("Item")
Watch = Callable[[Iterable[Any]], Iterator[Any]]


def watch(total: int, *, quiet: bool, what: str = "frame") -> Watch:
    """A wrapper that hands items on and shows how far they are, unless told to be quiet."""
    if quiet or not sys.stderr.isatty():
        return iter

    def watched(items: Iterable[Item]) -> Iterator[Item]:
        from tqdm import tqdm

        return iter(tqdm(items, total=total, unit=what, leave=False))

    return watched
