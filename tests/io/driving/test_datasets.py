"""Whatever the data set: every point is where it was and of what it was cast from."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest

from lidaraccum.errors import MissingInputError, SettingsError
from lidaraccum.geometry import rigid
from lidaraccum.io.driving.datasets import chosen_names, open_dataset
from lidaraccum.io.driving.log import LabelledLog

HALF_FLOAT_M = 0.02
"""Argoverse 2 rounds coordinates to half floats."""


@pytest.fixture
def log(written: Any) -> Any:
    return open_dataset(written.kind, written.root).open(written.name)


@pytest.fixture
def sequence(log: Any) -> LabelledLog:
    return LabelledLog(log)


def instances(log: Any) -> dict[str, int]:
    return {track.name: number for number, track in enumerate(log.tracks, start=1)}


def test_the_log_is_found_by_name(written: Any) -> None:
    dataset = open_dataset(written.kind, written.root)
    assert dataset.names == (written.name,)
    assert chosen_names(dataset, ()) == (written.name,)
    with pytest.raises(SettingsError, match=written.name):
        chosen_names(dataset, ("another",))


def test_points_decode_to_where_they_were_cast(written: Any, sequence: LabelledLog) -> None:
    assert len(sequence) == len(written.seconds)
    period_s = written.seconds[1] - written.seconds[0]
    assert sequence.rate_hz == pytest.approx(1 / period_s, rel=1e-4)
    for index in (2, 0, 1):
        made, frame = written.truth(index), sequence[index]
        expected = made.seen_from(written.world_from_frame(index))
        points = frame.points[: len(expected)]
        np.testing.assert_allclose(points, expected, atol=HALF_FLOAT_M)
        np.testing.assert_array_equal(frame.ring[: len(expected)], made.row)


def test_poses_are_the_true_ones(written: Any, sequence: LabelledLog) -> None:
    expected = [written.world_from_frame(index) for index in range(len(sequence))]
    np.testing.assert_allclose(sequence.poses, expected, atol=1e-6)
    found = [sequence.labels(index).world_from_sensor for index in range(len(sequence))]
    np.testing.assert_array_equal(sequence.poses, found)


def test_a_point_of_the_mover_is_the_movers_in_every_sweep(
    written: Any, log: Any, sequence: LabelledLog, logs: ModuleType
) -> None:
    number = instances(log)["mover"]
    for index in range(len(sequence)):
        labels, owner = sequence.labels(index), written.truth(index).owner
        own = labels.instance[: len(owner)] == number
        np.testing.assert_array_equal(own, owner == logs.MOVER)
        assert own.sum() > 10
        assert labels.dynamic[labels.instance == number].all()


def test_its_boxes_are_where_it_truly_was(
    written: Any, log: Any, sequence: LabelledLog, logs: ModuleType
) -> None:
    number, thing = instances(log)["mover"], logs.THINGS[logs.MOVER - 1]
    for index, seconds in enumerate(written.seconds):
        labels = sequence.labels(index)
        box = next(box for box in labels.boxes if box.id == number)
        np.testing.assert_allclose(
            labels.world_from_sensor @ box.sensor_from_object, thing.at(seconds), atol=1e-6
        )
        assert box.size_lwh == pytest.approx(thing.size)
        assert box.speed_mps == pytest.approx(np.hypot(*thing.velocity), abs=1e-3)


def test_what_is_parked_is_foreground_and_still(
    written: Any, log: Any, sequence: LabelledLog, logs: ModuleType
) -> None:
    number = instances(log)["parked"]
    for index in range(len(sequence)):
        labels, owner = sequence.labels(index), written.truth(index).owner
        own = labels.instance == number
        np.testing.assert_array_equal(own[: len(owner)], owner == logs.PARKED)
        assert labels.foreground[own].all()
        assert not labels.dynamic[own].any()


def test_what_cannot_move_is_background(
    written: Any, log: Any, sequence: LabelledLog, logs: ModuleType
) -> None:
    assert "sign" not in instances(log)
    labels, owner = sequence.labels(0), written.truth(0).owner
    assert (owner == logs.SIGN).any()
    assert not labels.foreground[: len(owner)][owner == logs.SIGN].any()


def test_where_boxes_are_only_guessed_nothing_is_scored(
    written: Any, log: Any, sequence: LabelledLog, logs: ModuleType
) -> None:
    """The walker is drawn late: before, its box is extrapolated or unknown."""
    number = instances(log)["walker"]
    first = next(
        place for place in written.drawn if written.seconds[place] >= logs.THINGS[2].drawn_from
    )
    for index in range(len(sequence)):
        labels, owner = sequence.labels(index), written.truth(index).owner
        own = labels.instance == number
        boxed = number in {box.id for box in labels.boxes}
        known = index >= first and sum(place >= first for place in written.drawn) > 1
        assert boxed == known
        if not known:
            assert not labels.annotated[own].any()
        elif written.kind != "waymo":
            assert labels.annotated[own].all()
            assert (owner == logs.WALKER)[own[: len(owner)]].all()


def test_what_is_known_does_not_depend_on_the_order_of_asking(sequence: LabelledLog) -> None:
    forwards = [sequence.labels(index).instance for index in range(3)]
    backwards = [sequence.labels(index).instance for index in (2, 1, 0)][::-1]
    for one, other in zip(forwards, backwards, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_folder_of_something_else_is_refused(written: Any, tmp_path: Any) -> None:
    with pytest.raises(MissingInputError, match=str(tmp_path)):
        open_dataset(written.kind, tmp_path).names  # noqa: B018


def test_movers_share_one_place_once_their_motion_is_undone(
    log: Any, sequence: LabelledLog, logs: ModuleType
) -> None:
    number, half = instances(log)["mover"], np.array(logs.THINGS[0].size) / 2
    for index in range(len(sequence)):
        labels = sequence.labels(index)
        box = next(box for box in labels.boxes if box.id == number)
        own = sequence[index].points[labels.instance == number]
        local = rigid.transform(rigid.invert(box.sensor_from_object), own)
        # Bodies fill nine tenths of their boxes.
        assert (np.abs(local) <= 0.9 * half + HALF_FLOAT_M).all()
