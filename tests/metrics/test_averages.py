"""Ratios and means that say NaN when there is nothing to average."""

from __future__ import annotations

from math import isnan, nan, sqrt

import numpy as np

from lidaraccum.metrics.averages import mean_of_known, over_scenes, ratio, ratios


def test_a_ratio_of_nothing_is_not_a_number() -> None:
    assert ratio(1, 4) == 0.25
    assert isnan(ratio(0, 0))
    np.testing.assert_array_equal(ratios(np.array([1, 0]), np.array([2, 0])), [0.5, nan])


def test_every_scene_counts_the_same_and_those_without_a_score_are_counted_apart() -> None:
    average = over_scenes([1.0, nan, 2.0, 6.0])
    assert (average.mean, average.scenes, average.undefined) == (3.0, 3, 1)
    assert average.deviation == sqrt((4 + 1 + 9) / 3)


def test_no_scene_at_all_has_no_average() -> None:
    for values in ([], [nan, nan]):
        average = over_scenes(values)
        assert isnan(average.mean)
        assert isnan(average.deviation)
        assert (average.scenes, average.undefined) == (0, len(values))
    assert isnan(mean_of_known(np.full(3, nan)))
