"""Movers that are one thing: its ends are, two that follow each other are not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from lidaraccum.pipeline.joining import join_parts
from lidaraccum.pipeline.motion_settings import BALANCED
from lidaraccum.pipeline.objects import WindowObject

VELOCITY = np.array([8.0, 1.0, 0.0])


@dataclass(frozen=True)
class OneCluster:
    """A frame in which everything hangs together."""

    points: np.ndarray
    index: int = 0
    stamp: float = 0.0

    def world(self, picked: np.ndarray) -> np.ndarray:
        return self.points[picked]

    def in_clusters_of(self, picked: np.ndarray) -> np.ndarray:
        return np.ones(len(self.points), dtype=np.bool_)


@pytest.mark.parametrize(("apart_m", "count"), [(10.0, 1), (24.0, 2)])
def test_the_ends_of_a_bus_are_one_and_two_cars_in_a_row_are_two(
    apart_m: float, count: int
) -> None:
    rng = np.random.default_rng(0)
    ahead = VELOCITY / np.linalg.norm(VELOCITY)
    end = rng.uniform(-1, 1, (80, 3))
    frame = OneCluster(np.concatenate([end, end + apart_m * ahead]))
    parts = [
        WindowObject({0: np.arange(80) + first}, VELOCITY, np.zeros(3), 0.0, 0.6)
        for first in (0, 80)
    ]
    joined = join_parts(parts, [frame], BALANCED)  # type: ignore[list-item]
    assert len(joined) == count
    assert sum(one.size for one in joined) == 160
