"""Boxes between the stamps at which they were drawn."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.io.driving.tracks import DrawnBoxes, Track, pose_between

DRAWN_AT = 0.5 * np.arange(6)


def pose(x: float, y: float = 0.0, yaw: float = 0.0) -> np.ndarray:
    made = rigid.exponential(np.array([0, 0, yaw, 0, 0, 0]))
    made[:2, 3] = x, y
    return made


def track(stamps: list[float], velocity: float = 6.0, turn: float = 0.4) -> Track:
    times = np.array(stamps)
    return Track(
        name="one",
        category="car",
        stamps=times,
        size_lwh=np.tile([4.0, 2.0, 1.5], (len(times), 1)),
        world_from_object=np.stack([pose(velocity * t, yaw=3.0 + turn * t) for t in times]),
    )


@pytest.mark.parametrize("stamp", [0.5, 0.55, 0.9, 1.0, 1.37, 1.5])
def test_a_steady_motion_is_met_at_every_stamp(stamp: float) -> None:
    """Also where the heading passes pi: the rotation takes the short way."""
    seen = track([0.5, 1.0, 1.5]).at(stamp, DRAWN_AT)
    assert seen is not None
    assert seen.certain
    np.testing.assert_allclose(
        seen.world_from_object, pose(6 * stamp, yaw=3 + 0.4 * stamp), atol=1e-12
    )
    assert seen.speed_mps == pytest.approx(6.0)


def test_a_drawn_box_is_kept_to_the_last_digit() -> None:
    drawn = track([0.5, 1.0, 1.5])
    seen = drawn.at(1.0, DRAWN_AT)
    assert seen is not None
    np.testing.assert_array_equal(seen.world_from_object, drawn.world_from_object[1])


def test_moving_the_world_moves_what_lies_between() -> None:
    rng = np.random.default_rng(2)
    first, second, world = (rigid.exponential(rng.normal(size=6)) for _ in range(3))
    np.testing.assert_allclose(
        world @ pose_between(first, second, 0.3),
        pose_between(world @ first, world @ second, 0.3),
        atol=1e-12,
    )


def test_there_and_back_meet_halfway() -> None:
    rng = np.random.default_rng(3)
    first, second = (rigid.exponential(rng.normal(size=6)) for _ in range(2))
    np.testing.assert_allclose(
        pose_between(first, second, 0.3), pose_between(second, first, 0.7), atol=1e-12
    )


@pytest.mark.parametrize("stamp", [0.1, 0.45, 1.6, 1.95])
def test_outside_what_was_drawn_the_box_goes_on_but_is_not_certain(stamp: float) -> None:
    seen = track([0.5, 1.0, 1.5]).at(stamp, DRAWN_AT)
    assert seen is not None
    assert not seen.certain
    assert seen.world_from_object[0, 3] == pytest.approx(6 * stamp)


@pytest.mark.parametrize("stamp", [0.0, 2.0, 2.3])
def test_where_somebody_looked_and_drew_nothing_there_is_nothing(stamp: float) -> None:
    assert track([0.5, 1.0, 1.5]).at(stamp, DRAWN_AT) is None


@pytest.mark.parametrize("stamp", [0.7, 1.0, 1.2])
def test_a_gap_is_bridged_but_not_certain(stamp: float) -> None:
    drawn = track([0.0, 0.5, 1.5, 2.0])
    bridged, before = drawn.at(stamp, DRAWN_AT), drawn.at(0.3, DRAWN_AT)
    assert bridged is not None
    assert not bridged.certain
    assert before is not None
    assert before.certain


def test_what_was_drawn_once_has_no_known_speed() -> None:
    seen = track([1.0]).at(1.0, DRAWN_AT)
    assert seen is not None
    assert not seen.certain
    assert track([1.0]).speed(1.0) is None


def test_the_jitter_of_drawn_boxes_is_no_motion() -> None:
    stamps = 0.1 * np.arange(40)
    rng = np.random.default_rng(5)
    places = np.tile(np.eye(4), (40, 1, 1))
    places[:, :2, 3] = rng.normal(0, 0.03, (40, 2))
    parked = Track("parked", "car", stamps, np.ones((40, 3)), places)
    assert max(parked.speed(stamp) or 0.0 for stamp in stamps) < 0.5


def test_speed_follows_a_stop() -> None:
    stamps = 0.1 * np.arange(40)
    way = np.minimum(stamps, 2.0) * 5.0
    places = np.stack([pose(x) for x in way])
    braking = Track("braking", "car", stamps, np.ones((40, 3)), places)
    assert braking.speed(0.0) == pytest.approx(5.0)
    assert braking.speed(1.0) == pytest.approx(5.0)
    assert braking.speed(2.0) == pytest.approx(2.5)
    assert braking.speed(3.9) == pytest.approx(0.0, abs=1e-9)


def test_boxes_become_tracks_whatever_their_order() -> None:
    rows = [("b", 0.5), ("a", 1.0), ("b", 0.0), ("c", 0.0), ("a", 0.5)]
    order = np.random.default_rng(0).permutation(len(rows))

    def tracks(chosen: list[int]) -> list[tuple[str, list[float]]]:
        boxes = DrawnBoxes(
            names=[rows[row][0] for row in chosen],
            categories=["car"] * len(chosen),
            stamps=np.array([rows[row][1] for row in chosen]),
            size_lwh=np.ones((len(chosen), 3)),
            world_from_object=np.stack([pose(rows[row][1]) for row in chosen]),
        )
        return [(one.name, one.stamps.tolist()) for one in boxes.tracks()]

    expected = [("b", [0.0, 0.5]), ("c", [0.0]), ("a", [0.5, 1.0])]
    assert tracks(list(range(5))) == tracks(order.tolist()) == expected


def test_a_box_of_nowhere_is_refused() -> None:
    with pytest.raises(InputError, match="non-finite"):
        DrawnBoxes(["a"], ["car"], np.zeros(1), np.ones((1, 3)), np.full((1, 4, 4), np.nan))
