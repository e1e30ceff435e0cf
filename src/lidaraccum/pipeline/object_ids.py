"""One row of ids for all objects of a run, moving or still."""

from __future__ import annotations


class ObjectIds:
    """Hands out 1, 2, 3, ..., each once."""

    def __init__(self) -> None:
        self._last = 0

    def new(self) -> int:
        """An id that nobody has."""
        self._last += 1
        return self._last
