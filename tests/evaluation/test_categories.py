"""Every data set's words fall into five kinds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lidaraccum.evaluation.categories import (
    BACKGROUND,
    CAR,
    OTHER_VEHICLE,
    PEDESTRIAN,
    WHEELED,
    category_of,
    point_categories,
)


@pytest.mark.parametrize(
    ("word", "category"),
    [
        ("Car", CAR),
        ("Van", OTHER_VEHICLE),
        ("Tram", OTHER_VEHICLE),
        ("Person_sitting", PEDESTRIAN),
        ("Pedestrian", PEDESTRIAN),
        ("Cyclist", WHEELED),
        ("MOTORCYCLE", WHEELED),
        ("regular_vehicle", CAR),
        ("vehicular_trailer", OTHER_VEHICLE),
        ("construction", OTHER_VEHICLE),
        ("pedestrian.adult", PEDESTRIAN),
        ("official_signaler", PEDESTRIAN),
        ("dog", PEDESTRIAN),
        ("wheeled_rider", WHEELED),
        ("something else", OTHER_VEHICLE),
    ],
)
def test_a_word_is_of_a_kind(word: str, category: int) -> None:
    assert category_of(word) == category


def test_points_are_of_the_kind_of_their_box(hand_made: Any) -> None:
    labels = hand_made.labels(1)
    expected = [BACKGROUND] * 3 + [CAR] * 2 + [PEDESTRIAN]
    np.testing.assert_array_equal(point_categories(labels), expected)
