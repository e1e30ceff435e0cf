"""Which sweeps of a log become frames."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.errors import InputError
from lidaraccum.io.driving.log import DrivingLog, LabelledLog, Sweep

STAMPS = 100 + 0.05 * np.arange(10)


def log(drawn: list[int]) -> DrivingLog:
    points = np.ones((3, 3), dtype="f4")
    return DrivingLog(
        name="a",
        dataset="made up",
        sensor="",
        licence="",
        coordinates="",
        stamps=STAMPS,
        world_from_sensor=np.tile(np.eye(4), (10, 1, 1)),
        drawn_at=STAMPS[drawn],
        tracks=(),
        read=lambda index: Sweep(Frame(points, stamp=float(STAMPS[index]))),
    )


@pytest.mark.parametrize("drawn", [[2, 6], [2, 3, 6], [0, 9]])
def test_only_sweeps_between_drawn_ones_are_frames(drawn: list[int]) -> None:
    sequence = LabelledLog(log(drawn))
    expected = STAMPS[drawn[0] : drawn[-1] + 1]
    assert [sequence[index].stamp for index in range(len(sequence))] == expected.tolist()
    assert sequence.poses.shape == (len(expected), 4, 4)
    assert sequence.rate_hz == pytest.approx(20)


@pytest.mark.parametrize("drawn", [[], [4]])
def test_a_log_without_boxes_is_refused(drawn: list[int]) -> None:
    with pytest.raises(InputError, match="annotated sweeps of 10"):
        LabelledLog(log(drawn))


def test_without_an_object_all_is_annotated_background() -> None:
    labels = LabelledLog(log([0, 9])).labels(4)
    assert not labels.foreground.any()
    assert labels.annotated is not None
    assert labels.annotated.all()
