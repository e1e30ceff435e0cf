"""A distribution in bins says what the sorted values say, to within its stated bound."""

from __future__ import annotations

from math import isnan

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.metrics.distribution import (
    BIN_RATIO,
    COARSEST_M,
    EDGES_M,
    FINEST_M,
    DistanceDistribution,
    shares_below,
)


def log_normal(count: int, seed: int = 0) -> NDArray[np.float64]:
    return np.random.default_rng(seed).lognormal(mean=-3.0, sigma=2.0, size=count)


def test_the_bins_are_as_fine_as_promised() -> None:
    inner = EDGES_M[1:-1]
    assert (inner[1:] / inner[:-1] <= BIN_RATIO).all()
    np.testing.assert_allclose(inner[[0, -1]], [FINEST_M, COARSEST_M])


@pytest.mark.parametrize("count", [1, 2, 3, 1000, 1001])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_a_quantile_is_within_its_bound(count: int, share: float) -> None:
    distances = log_normal(count)
    exact = np.quantile(distances, share)
    found = DistanceDistribution.of(distances).quantile(share)
    assert abs(found - exact) <= max(0.0025 * exact, 5e-5)


def test_the_median_between_two_far_halves_is_their_middle() -> None:
    distances = np.array([0.01, 0.01, 3.0, 3.0])
    assert DistanceDistribution.of(distances).median == pytest.approx(1.505, rel=0.0025)


def test_equal_distances_have_themselves_as_median() -> None:
    for distance in (0.0, 1e-5, 0.123456, 5e4):
        assert DistanceDistribution.of(np.full(7, distance)).median == distance


def test_pooling_windows_is_counting_all_points() -> None:
    parts = [log_normal(100, seed) for seed in range(5)]
    pooled = DistanceDistribution.pool(DistanceDistribution.of(part) for part in parts)
    whole = DistanceDistribution.of(np.concatenate(parts))
    np.testing.assert_array_equal(pooled.counts, whole.counts)
    assert (pooled.smallest, pooled.largest) == (whole.smallest, whole.largest)
    assert len(pooled) == 500


def test_the_cumulative_distribution_is_exact_at_the_edges() -> None:
    # Values on edges too: the share is of those strictly below.
    distances = np.concatenate([log_normal(500), EDGES_M[100:2000:7]])
    at = EDGES_M[:-1]
    found = DistanceDistribution.of(distances).shares_below(at)
    np.testing.assert_array_equal(found, [np.mean(distances < place) for place in at])


def test_between_the_edges_it_is_off_by_less_than_the_bin_holds() -> None:
    distances = log_normal(2000)
    at = np.geomspace(1e-3, 10.0, 101)
    distribution = DistanceDistribution.of(distances)
    in_bin = distribution.counts[np.searchsorted(EDGES_M, at, side="right") - 1] / 2000
    off = np.abs(distribution.shares_below(at) - shares_below(distances, at))
    assert (off <= in_bin + 1e-12).all()


def test_the_exact_cumulative_distribution_is_that_of_the_paper() -> None:
    found = shares_below(np.array([3.0, 1.0, 2.0, 2.0]), np.array([0.5, 1.0, 2.0, 2.5, 9.0]))
    np.testing.assert_array_equal(found, [0.0, 0.0, 0.25, 0.75, 1.0])


def test_no_distance_has_no_distribution() -> None:
    nothing = DistanceDistribution.pool(())
    assert len(nothing) == 0
    assert isnan(nothing.median)
    assert np.isnan(nothing.shares_below(np.array([0.1, 1.0]))).all()
    assert np.isnan(shares_below(np.zeros(0), np.array([0.1]))).all()


@pytest.mark.parametrize("wrong", [-1.0, np.nan])
def test_what_is_no_distance_is_refused(wrong: float) -> None:
    with pytest.raises(InputError, match="distances"):
        DistanceDistribution.of(np.array([1.0, wrong]))
