"""Baselines that are told the masks: what each makes of a car that drives on."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.evaluation.told_masks import Finder, by_centroids, by_icp, by_tracking
from lidaraccum.geometry import rigid

STAMPS = [0.0, 0.1, 0.2, 0.3, 0.4]
STEP = np.array([0.8, 0.1, 0.0])
FINDERS = (by_centroids, by_icp, by_tracking)


def body() -> np.ndarray:
    rng = np.random.default_rng(4)
    points = rng.uniform(0, 1, (1500, 3))
    side = rng.integers(0, 3, 1500)
    points[np.arange(1500), side] = np.round(points[np.arange(1500), side])
    return points * [4.0, 1.8, 1.5]


def driving() -> list[np.ndarray]:
    return [body() + index * STEP for index in range(5)]


@pytest.mark.parametrize("find", FINDERS)
@pytest.mark.parametrize("target", [0, 2, 4])
def test_a_whole_car_is_taken_to_where_the_target_shows_it(find: Finder, target: int) -> None:
    points = driving()
    found = find(points, STAMPS, target)
    slack = 0.02 if find is not by_tracking else 0.3
    for own, ids, motions in zip(points, found.ids, found.now_from_anchor, strict=True):
        instance = int(np.bincount(ids).argmax())
        assert instance > 0
        placed = rigid.transform(rigid.invert(motions[instance]), own)
        assert np.abs(placed - points[target]).max() < slack


@pytest.mark.parametrize("find", FINDERS)
def test_an_object_that_the_target_lacks_goes_to_the_nearest_frame_that_shows_it(
    find: Finder,
) -> None:
    points = driving()
    points[0] = points[0][:0]
    found = find(points, STAMPS, 0)
    assert not found.now_from_anchor[0]
    (anchor,) = found.now_from_anchor[1].values()
    np.testing.assert_allclose(anchor, np.eye(4), atol=0.02)


@pytest.mark.parametrize("find", FINDERS)
def test_a_window_without_movers_has_none(find: Finder) -> None:
    found = find([np.zeros((0, 3))] * 3, STAMPS[:3], 0)
    assert [len(ids) for ids in found.ids] == [0, 0, 0]
    assert not any(found.now_from_anchor)
