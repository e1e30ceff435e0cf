"""Working ahead changes when items are made, nothing else."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from lidaraccum.errors import InputError
from lidaraccum.pipeline.ahead import FRAMES_AHEAD, ahead
from lidaraccum.pipeline.motion_settings import PRESETS


def numbers(made: list[int], broken: int = -1) -> Iterator[int]:
    """Six numbers, noted when they are made; one of them may not be makeable."""
    for number in range(6):
        made.append(number)
        if number == broken:
            raise InputError(f"number {number} is broken")
        yield number


def test_items_come_in_order() -> None:
    assert list(ahead(numbers([]))) == list(range(6))
    assert list(ahead(iter(()))) == []


def test_no_more_than_a_few_are_made_ahead() -> None:
    made: list[int] = []
    items = ahead(numbers(made))
    next(items)
    items.close()
    assert max(made) <= FRAMES_AHEAD


def test_a_stride_of_frames_is_made_while_a_window_is_searched() -> None:
    assert all(settings.stride <= FRAMES_AHEAD for settings in PRESETS.values())


def test_an_error_comes_when_its_item_is_due() -> None:
    items = ahead(numbers([], broken=2))
    assert [next(items) for _ in range(2)] == [0, 1]
    with pytest.raises(InputError, match="number 2"):
        next(items)


def test_no_thread_is_left_behind() -> None:
    before = threading.active_count()
    items = ahead(ahead(numbers([])))
    next(items)
    items.close()
    assert threading.active_count() == before
