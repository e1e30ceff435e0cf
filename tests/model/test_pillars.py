"""Pillars are told by so many of their points at most: rays in plenty change nothing."""

from __future__ import annotations

import pytest
import torch

from lidaraccum.data.frame import Frame
from lidaraccum.model.batch import FrameTensors, prepare, to_tensors
from lidaraccum.model.pillars import speakers
from lidaraccum.model.settings import NetworkSettings


@pytest.fixture(scope="module")
def two(frames: list[Frame], settings: NetworkSettings) -> FrameTensors:
    return to_tensors([prepare(frame, settings, 32.0) for frame in frames[:2]])


@pytest.mark.parametrize("most", [0, 1, 2, 7, 10_000])
def test_each_pillar_is_told_by_so_many_of_its_own_points(two: FrameTensors, most: int) -> None:
    points, pillar = speakers(two, most)
    assert (two.pillar[points] == pillar).all()
    assert len(points.unique()) == len(points)
    all_of_it, told = torch.bincount(two.pillar), torch.bincount(pillar)
    assert (told == (all_of_it.clamp(max=most) if most else all_of_it)).all()


def test_the_lowest_and_the_highest_always_tell(two: FrameTensors) -> None:
    points, pillar = speakers(two, 2)
    start = two.height.new_zeros(len(two.pillar_cell))
    for way in ("amin", "amax"):
        most = start.scatter_reduce(0, two.pillar, two.height, way, include_self=False)
        told = start.scatter_reduce(0, pillar, two.height[points], way, include_self=False)
        assert (most == told).all()
