"""Laws of order."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry.order import middle, sorted_rows


@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_half_of_the_values_lie_below_the_middle(count: int) -> None:
    values = np.random.default_rng(count).permutation(count)
    assert middle(values) == count // 2


def test_rows_come_in_the_order_of_their_numbers_equal_ones_as_they_were() -> None:
    numbers = np.random.default_rng(0).integers(0, 50, 1000)
    rows, ordered = sorted_rows(numbers)
    np.testing.assert_array_equal(rows, np.argsort(numbers, kind="stable"))
    np.testing.assert_array_equal(ordered, np.sort(numbers))
