"""Small clouds that look like a sensor's, and accumulated frames that look like the pipeline's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.data.accumulation import AccumulatedFrame


@pytest.fixture
def cloud() -> Callable[..., NDArray[np.float32]]:
    """Points (N, 3) float32 around a sensor, 2 to 60 m away."""

    def make(count: int = 200, seed: int = 0) -> NDArray[np.float32]:
        rng = np.random.default_rng(seed)
        angle = rng.uniform(-np.pi, np.pi, count)
        reach = rng.uniform(2, 60, count)
        height = rng.uniform(-1.7, 3, count)
        return np.column_stack([reach * np.cos(angle), reach * np.sin(angle), height]).astype("f4")

    return make


@pytest.fixture
def accumulated() -> Callable[..., AccumulatedFrame]:
    """One accumulated frame with a column of every kind."""

    def make(
        index: int = 0,
        count: int = 50,
        shift: tuple[float, float, float] = (0.0, 0.0, 0.0),
        attributes: dict[str, NDArray[Any]] | None = None,
    ) -> AccumulatedFrame:
        rng = np.random.default_rng(index)
        # Whole millimetres, so that LAS holds them exactly.
        points = np.round(rng.uniform(-60, 60, (count, 3)), 3) + np.asarray(shift)
        if attributes is None:
            attributes = {
                "intensity": rng.integers(0, 65536, count).astype(np.uint16),
                "ring": rng.integers(0, 64, count).astype(np.uint8),
                "range_mm": rng.integers(0, 2**32, count).astype(np.uint32),
                "near_ir": rng.random(count).astype(np.float32),
                "azimuth": rng.random(count),
                "offset": rng.integers(-100, 100, count).astype(np.int16),
            }
        return AccumulatedFrame(
            index=index,
            points=points,
            rows=np.arange(count),
            row_count=count,
            label=rng.integers(0, 3, count).astype(np.uint8),
            instance=rng.integers(0, 70000, count).astype(np.int32),
            confidence=rng.random(count).astype(np.float32),
            time=0.1 * index + rng.uniform(0, 0.1, count),
            range_m=np.linalg.norm(points, axis=1).astype(np.float32),
            stamp=100.0 + 0.1 * index,
            reference_from_sensor=np.eye(4),
            attributes=attributes,
        )

    return make
