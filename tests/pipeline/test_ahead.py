"""Reading ahead changes when frames are read, nothing else."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.errors import InputError
from lidaraccum.pipeline.read_ahead import FRAMES_AHEAD, read_ahead


@dataclass
class Numbered:
    """Frames that know their number; one of them may be broken."""

    broken: int = -1
    read: list[int] = field(default_factory=list)
    name: str = "numbered"
    rate_hz: float = 10.0
    poses: None = None
    crs_wkt: None = None

    def __len__(self) -> int:
        return 6

    def __getitem__(self, index: int, /) -> Frame:
        self.read.append(index)
        if index == self.broken:
            raise InputError(f"frame {index} is broken")
        return Frame(np.full((3, 3), index, dtype=np.float32))


def test_frames_come_in_order() -> None:
    assert [frame.points[0, 0] for frame in read_ahead(Numbered())] == list(range(6))


def test_no_more_than_a_few_are_read_ahead() -> None:
    sequence = Numbered()
    frames = read_ahead(sequence)
    next(frames)
    assert max(sequence.read) <= FRAMES_AHEAD
    frames.close()


def test_an_error_comes_when_its_frame_is_due() -> None:
    frames = read_ahead(Numbered(broken=2))
    assert [next(frames).points[0, 0] for _ in range(2)] == [0, 1]
    with pytest.raises(InputError, match="frame 2"):
        next(frames)


def test_no_thread_is_left_behind() -> None:
    before = threading.active_count()
    frames = read_ahead(Numbered())
    next(frames)
    frames.close()
    assert threading.active_count() == before
