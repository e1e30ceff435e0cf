"""A pause in the stream: items wait on disk until the last of them has been seen."""

from __future__ import annotations

import pickle
import tempfile
from collections.abc import Iterable, Iterator
from typing import TypeVar

from lidaraccum.errors import OutputError

Item = TypeVar("Item")


def after_the_last(items: Iterable[Item]) -> Iterator[Item]:
    """Draw all items first, then hand them on in order; memory holds one at a time.

    The items lie in an unnamed temporary file meanwhile, in the system's temporary folder.
    """
    with tempfile.TemporaryFile() as waiting:
        count = 0
        for item in items:
            try:
                pickle.dump(item, waiting, protocol=pickle.HIGHEST_PROTOCOL)
            except OSError as error:
                raise OutputError(
                    f"frames cannot wait in the temporary folder: {error.strerror or error}",
                    hint="TMPDIR names another; --reference first needs none",
                ) from error
            count += 1
        waiting.seek(0)
        for _ in range(count):
            yield pickle.load(waiting)
