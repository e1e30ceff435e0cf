"""A table is read between its cells' centres, and goes on beyond the outermost."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from lidaraccum.geometry.grid import interpolated


@pytest.mark.parametrize(("dtype", "within"), [(np.float64, 1e-12), (np.float32, 1e-4)])
def test_it_is_what_scipy_reads(dtype: type, within: float) -> None:
    rng = np.random.default_rng(0)
    table = rng.normal(size=(10, 10))
    x, y = rng.uniform(-12, 12, (2, 500)).astype(dtype)
    found = interpolated(table, x, y, reach_m=10.0, cell_m=2.0)
    cells = (np.stack([x, y]) + 10.0) / 2.0 - 0.5
    expected = ndimage.map_coordinates(table, cells, order=1, mode="nearest")
    assert found.dtype == dtype
    np.testing.assert_allclose(found, expected, atol=within)
