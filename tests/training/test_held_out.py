"""What validates a run on recordings never teaches it."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from lidaraccum.errors import InputError
from lidaraccum.training.held_out import HeldOutSequences, hold_out


@pytest.mark.parametrize("count", [1, 2, 3, 5, 9, 23])
def test_every_sequence_teaches_or_validates_and_none_does_both(count: int) -> None:
    names = [f"{number:03d}" for number in range(count)]
    learned, held = hold_out(names)
    assert sorted([*learned, *held]) == names
    assert not set(learned) & set(held)
    assert learned
    assert bool(held) == (count > 1)
    assert len(held) <= max(1, count // 5)
    assert hold_out(names[::-1]) == (learned, held)


def test_the_same_number_gives_the_same_window_as_it_is(toy: ModuleType) -> None:
    held = HeldOutSequences(("3", "8"), lambda name: toy.CarPark(int(name)), toy.SMALL, 16.0)
    (one,), (again,), (other,) = held.windows(0), held.windows(0), held.windows(1)
    assert [len(window.frames) for window in (one, other)] == [5, 5]
    assert one.target == 0
    for frame, same in zip(one.frames, again.frames, strict=True):
        assert np.array_equal(frame.points, same.points)
    assert not np.array_equal(one.frames[0].points, other.frames[0].points)


def test_places_follow_one_another_through_long_sequences(toy: ModuleType) -> None:
    held = HeldOutSequences(("3",), lambda name: toy.CarPark(int(name), 12), toy.SMALL, 16.0)
    stamps = [held.windows(number)[0].frames[0].stamp for number in range(3)]
    assert stamps == pytest.approx([0.0, 0.5, 0.0])


def test_one_frame_is_no_window(toy: ModuleType) -> None:
    held = HeldOutSequences(("3",), lambda name: toy.CarPark(int(name), 1), toy.SMALL, 16.0)
    with pytest.raises(InputError, match="too few"):
        held.windows(0)
