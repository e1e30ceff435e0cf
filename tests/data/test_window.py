"""A window is a small sequence of its own."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from lidaraccum.data.frame import Frame, Labels
from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.data.window import Window, windows
from lidaraccum.errors import SettingsError


class Counted:
    """Seven frames, each a single point that says which; counts what is read."""

    name, rate_hz, poses, crs_wkt = "counted", 10.0, None, None

    def __init__(self) -> None:
        self.read: Counter[int] = Counter()

    def __len__(self) -> int:
        return 7

    def __getitem__(self, index: int, /) -> Frame:
        self.read[index] += 1
        return Frame(np.full((1, 3), index, dtype=np.float32), stamp=0.1 * index)

    def labels(self, index: int, /) -> Labels:
        pose = np.eye(4)
        pose[0, 3] = index
        nothing = np.zeros(1, dtype=bool)
        return Labels(pose, nothing, nothing, np.zeros(1, dtype=np.int32))


def test_a_window_shows_its_frames_and_labels_under_their_own_numbers() -> None:
    window = Window(Counted(), 2, 4)
    assert isinstance(window, LabelledSequence)
    assert len(window) == 4
    assert [frame.points[0, 0] for frame in window] == [2, 3, 4, 5]
    assert window.true_poses[:, 0, 3].tolist() == [2, 3, 4, 5]
    assert window[-1].points[0, 0] == 5
    with pytest.raises(IndexError):
        window[4]


@pytest.mark.parametrize(("name", "index"), [("first", 0), ("middle", 2), ("last", 4)])
def test_the_target_is_the_frame_it_is_called(name: str, index: int) -> None:
    assert Window(Counted(), 0, 5, name).target == index


def test_a_window_reads_each_frame_once_and_its_twin_none() -> None:
    sequence = Counted()
    window = Window(sequence, 1, 3, "last")
    twin = window.with_poses(np.tile(np.eye(4), (3, 1, 1)))
    for one in (window, window, twin):
        assert len(list(one)) == 3
        assert one.true_poses.shape == (3, 4, 4)
    assert sequence.read == {1: 1, 2: 1, 3: 1}
    assert window.poses is None
    assert twin.poses is not None
    assert twin.target == window.target


def test_windows_lie_a_stride_apart_and_never_reach_over_the_end() -> None:
    assert [one.start for one in windows(Counted(), 3, 2)] == [0, 2, 4]
    assert [one.start for one in windows(Counted(), 7, 1)] == [0]
    assert list(windows(Counted(), 8, 1)) == []


@pytest.mark.parametrize(("start", "length"), [(0, 1), (-1, 3), (5, 3)])
def test_a_window_that_does_not_fit_is_refused(start: int, length: int) -> None:
    with pytest.raises(SettingsError):
        Window(Counted(), start, length)


def test_an_unknown_target_and_no_stride_are_refused() -> None:
    with pytest.raises(SettingsError, match="nearest"):
        Window(Counted(), 0, 3, "nearest")
    with pytest.raises(SettingsError, match="stride"):
        list(windows(Counted(), 3, 0))
