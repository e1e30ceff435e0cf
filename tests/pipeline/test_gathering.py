"""A mover's points are those that go with it: not what stands beside it, not strays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from lidaraccum.pipeline.gathering import length_along, seconds_at_place, without_strays


@dataclass(frozen=True)
class Dots:
    """As much of a frame as is asked for."""

    points: np.ndarray


def test_few_points_far_from_the_others_are_not_a_movers() -> None:
    rng = np.random.default_rng(0)
    body, strays = rng.uniform(0, 1, (300, 3)), rng.uniform(4, 4.5, (5, 3))
    frame = Dots(np.concatenate([body, strays]))
    kept = without_strays(frame, np.arange(305))  # type: ignore[arg-type]
    assert kept.tolist() == list(range(300))


@pytest.mark.parametrize("count", [1, 2, 200])
def test_points_that_are_all_apart_stay(count: int) -> None:
    frame = Dots(np.arange(count)[:, None] * np.array([[5.0, 0.0, 0.0]]))
    kept = without_strays(frame, np.arange(count))  # type: ignore[arg-type]
    assert len(kept) == count


def test_a_long_thing_is_longer_at_its_place_than_a_wide_one() -> None:
    bus = np.array([[0.0, 0.0, 0.0], [12.0, 2.5, 3.0]])
    ahead, aside = np.array([6.0, 0.0, 0.0]), np.array([0.0, 6.0, 0.0])
    assert seconds_at_place(length_along(bus, ahead), ahead) == pytest.approx(12.3 / 6)
    assert seconds_at_place(length_along(bus, aside), aside) == pytest.approx(2.8 / 6)
