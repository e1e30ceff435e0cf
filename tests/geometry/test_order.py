"""The law of the middle value."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.geometry.order import middle


@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_half_of_the_values_lie_below_the_middle(count: int) -> None:
    values = np.random.default_rng(count).permutation(count)
    assert middle(values) == count // 2
