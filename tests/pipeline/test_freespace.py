"""Evidence: what another frame saw through moved, what it met may stand, the rest is unknown."""

from __future__ import annotations

from typing import Any

import numpy as np

from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import BALANCED


def watched(street: Any, first: int, second: int) -> SightedFrame:
    """Frame ``first`` after frame ``second`` has watched it."""
    frame = SightedFrame(street.frames[first], BALANCED)
    SightedFrame(street.frames[second], BALANCED).watch(frame)
    return frame


def test_a_mover_was_not_there_before(busy_street: Any) -> None:
    frame = watched(busy_street, 6, 2)
    car = busy_street.on[6][frame.rows] == 1
    assert (frame.through[car] == 1).mean() > 0.8


def test_walls_are_never_seen_through(busy_street: Any) -> None:
    frame = watched(busy_street, 6, 2)
    still = busy_street.on[6][frame.rows] == 0
    assert (frame.through[still] == 1).mean() < 0.005
    assert (frame.met[still] == 1).mean() > 0.5


def test_hidden_is_unknown(look: Any, new_mover: Any) -> None:
    screen = new_mover(low=(-30, 2.9, 0), size=(60, 0.2, 3), velocity=(0, 0, 60.0))
    street = look([screen], count=2, speed=0.0)
    frame = watched(street, 1, 0)
    points = frame.points
    behind = (points[:, 1] > 4) & (np.abs(points[:, 0]) < 12)
    assert behind.sum() > 100
    assert not frame.through[behind].any()
    assert not frame.met[behind].any()


def test_obstacles_stand_on_the_ground_and_away_from_the_carrier(busy_street: Any) -> None:
    frame = SightedFrame(busy_street.frames[0], BALANCED)
    assert frame.heights.min() >= BALANCED.min_height_m
    assert frame.heights.max() < BALANCED.max_height_m
    assert np.linalg.norm(frame.points, axis=1).min() > BALANCED.min_range_m - 0.01
    assert (busy_street.on[0][frame.low_rows] >= 0).all()
    assert not set(frame.rows.tolist()) & set(frame.low_rows.tolist())


def test_what_stands_outlasts_what_passes(busy_street: Any) -> None:
    frames = [SightedFrame(registered, BALANCED) for registered in busy_street.frames]
    for frame in frames:
        for other in frames:
            if other is not frame:
                frame.watch(other)
    middle = frames[4]
    everything = np.arange(len(middle.rows))
    stands = busy_street.on[4][middle.rows] == 0
    met_by_all = middle.met == len(frames) - 1
    car = busy_street.on[4][middle.rows] == 1
    passing_s = (4.2 + 0.3) / 8.0
    outlasts = middle.outlasts(everything, passing_s)
    assert not outlasts[car].any()
    assert outlasts[stands & met_by_all].mean() > 0.98
    assert not middle.outlasts(everything, 0.8).any(), "nobody watched for longer than that"
