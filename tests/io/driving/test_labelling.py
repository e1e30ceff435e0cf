"""What lies in a box is of its object."""

from __future__ import annotations

import numpy as np

from lidaraccum.geometry import rigid
from lidaraccum.io.driving.labelling import Sighted, SortedPoints, label
from lidaraccum.io.driving.tracks import Sighting


def sighted(
    number: int,
    place: tuple[float, float, float],
    size: tuple[float, float, float] = (4.0, 2.0, 2.0),
    speed: float = 0.0,
    certain: bool = True,
) -> Sighted:
    sighting = Sighting(rigid.translation(place), np.array(size), speed, certain)
    return Sighted(number, "car", sighting)


POINTS = np.array([[0, 0, 0], [5, 0, 0], [6.9, 0.9, -0.9], [7.1, 0, 0], [5, 1.1, 0]], dtype="f4")


def test_points_inside_are_the_objects() -> None:
    found = label(POINTS, np.eye(4), (sighted(3, (5, 0, 0), speed=2.0),))
    np.testing.assert_array_equal(found.instance, [0, 3, 3, 0, 0])
    np.testing.assert_array_equal(found.foreground, found.instance > 0)
    np.testing.assert_array_equal(found.dynamic, found.instance > 0)
    assert found.annotated is not None
    assert found.annotated.all()


def test_moving_the_sensor_and_its_points_changes_nothing() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-6, 6, (2000, 3)).astype("f4")
    objects = tuple(sighted(n, tuple(rng.uniform(-5, 5, 3)), speed=n - 2) for n in range(1, 6))
    away = rigid.exponential(rng.normal(size=6))
    moved = rigid.transform(rigid.invert(away), points).astype("f4")
    one, other = label(points, np.eye(4), objects), label(moved, away, objects)
    assert np.count_nonzero(one.instance) > 100
    np.testing.assert_array_equal(one.instance, other.instance)
    np.testing.assert_array_equal(one.dynamic, other.dynamic)


def test_sorted_points_find_what_a_plain_search_finds() -> None:
    rng = np.random.default_rng(4)
    points = rng.uniform(-30, 30, (5000, 3)).astype("f4")
    for _ in range(20):
        box, size = rigid.exponential(rng.normal(0, 3, 6)), rng.uniform(0.5, 12, 3)
        local = rigid.transform(rigid.invert(box), points)
        plain = np.flatnonzero((np.abs(local) <= size / 2).all(axis=1))
        np.testing.assert_array_equal(np.sort(SortedPoints(points).inside(box, size)), plain)


def test_the_smaller_box_comes_first() -> None:
    lorry = sighted(1, (5, 0, 0), (8.0, 3.0, 4.0), speed=9.0)
    beside = sighted(2, (6.5, 0.5, -0.5), (1.0, 1.0, 1.0))
    for objects in ((lorry, beside), (beside, lorry)):
        found = label(POINTS, np.eye(4), objects)
        np.testing.assert_array_equal(found.instance, [0, 1, 2, 1, 1])
        np.testing.assert_array_equal(found.dynamic, [False, True, False, True, True])


def test_a_guessed_box_labels_its_points_but_they_do_not_count() -> None:
    guess = sighted(1, (5, 0, 0), speed=3.0, certain=False)
    found = label(POINTS, np.eye(4), (guess,))
    np.testing.assert_array_equal(found.instance, [0, 1, 1, 0, 0])
    np.testing.assert_array_equal(found.annotated, [True, False, False, True, True])
    assert found.boxes == ()


def test_a_certain_box_comes_before_a_guess_of_any_size() -> None:
    guess = sighted(1, (5, 0, 0), (1.0, 1.0, 1.0), certain=False)
    found = label(POINTS, np.eye(4), (guess, sighted(2, (5, 0, 0))))
    np.testing.assert_array_equal(found.instance, [0, 2, 2, 0, 0])
    assert found.annotated is not None
    assert found.annotated.all()


def test_what_the_data_set_knows_nothing_of_stays_unscored() -> None:
    scored = np.array([True, False, True, True, False])
    found = label(POINTS, np.eye(4), (sighted(1, (5, 0, 0)),), scored)
    np.testing.assert_array_equal(found.annotated, scored)
    np.testing.assert_array_equal(found.instance, [0, 1, 1, 0, 0])


def test_half_a_metre_a_second_is_still() -> None:
    objects = (sighted(1, (5, 0, 0), speed=0.5), sighted(2, (50, 0, 0), speed=0.51))
    assert [box.dynamic for box in label(POINTS, np.eye(4), objects).boxes] == [False, True]
