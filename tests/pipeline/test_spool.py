"""The spool hands on what it was given, once the last has come."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lidaraccum.pipeline.spool import after_the_last


def test_items_come_back_in_order_and_only_after_the_last() -> None:
    seen = []

    def items() -> Iterator[np.ndarray]:
        for number in range(4):
            seen.append(number)
            yield np.full(1000, number)

    spooled = after_the_last(items())
    first = next(spooled)
    assert seen == [0, 1, 2, 3]
    assert [int(part[0]) for part in [first, *spooled]] == [0, 1, 2, 3]
