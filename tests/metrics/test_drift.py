"""Drift: KITTI's segments against a plain loop, hand-computed cases, laws."""

from __future__ import annotations

from math import isnan

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.geometry import rigid
from lidaraccum.metrics.drift import SegmentDrift, end_drift, segment_drift

Poses = NDArray[np.float64]


def straight(steps: int, scale: float = 1.0) -> Poses:
    poses = np.tile(np.eye(4), (steps, 1, 1))
    poses[:, 0, 3] = np.arange(steps) * scale
    return poses


def turning(steps: int, seed: int, noise: float) -> Poses:
    twists = np.tile([0.0, 0.0, 0.02, 1.0, 0.0, 0.0], (steps, 1))
    twists += np.random.default_rng(seed).normal(0.0, noise, (steps, 6))
    poses = [np.eye(4)]
    for twist in twists:
        poses.append(poses[-1] @ rigid.exponential(twist))
    return np.stack(poses)


def test_a_path_told_too_long_drifts_by_that_share() -> None:
    true, told = straight(300), straight(300, scale=1.02)
    drift = segment_drift(told, true)
    # A segment ends at the first frame beyond its length, here 1 m beyond.
    assert drift.of_length(100.0).translation_share == pytest.approx(0.02 * 101 / 100)
    assert drift.rotation_per_metre == pytest.approx(0.0, abs=1e-9)
    assert sorted(set(drift.length_m)) == [100.0, 200.0]
    assert len(drift.of_length(200.0)) == 10
    end = end_drift(told, true)
    assert end.errors.translation_m[0] == pytest.approx(0.02 * 299)
    assert end.translation_share == pytest.approx(0.02)


def test_segments_are_those_of_a_plain_loop() -> None:
    true, told = turning(80, 0, 0.01), turning(80, 1, 0.01)
    steps = np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1)
    shares, turns = [], []
    for length in (10.0, 25.0):
        for start in range(0, 81, 10):
            gone, end = 0.0, start
            while gone <= length and end < 80:
                gone += steps[end]
                end += 1
            if gone <= length:
                continue
            true_motion = np.linalg.inv(true[start]) @ true[end]
            told_motion = np.linalg.inv(told[start]) @ told[end]
            error = np.linalg.inv(told_motion) @ true_motion
            shares.append(np.linalg.norm(error[:3, 3]) / length)
            turns.append(rigid.rotation_angle(error) / length)
    drift = segment_drift(told, true, lengths_m=(10.0, 25.0))
    assert len(drift) == len(shares)
    assert drift.translation_share == pytest.approx(np.mean(shares))
    assert drift.rotation_per_metre == pytest.approx(np.mean(turns))


def test_the_truth_does_not_drift_wherever_it_starts() -> None:
    true = turning(60, 0, 0.0)
    moved = rigid.exponential(np.array([0.1, 0.2, 0.3, 9.0, 8.0, 7.0])) @ true
    for drift in (segment_drift(moved, true, lengths_m=(5.0, 20.0)), end_drift(moved, true)):
        assert drift.translation_share == pytest.approx(0.0, abs=1e-9)
        assert drift.rotation_per_metre == pytest.approx(0.0, abs=1e-7)


def test_a_drive_too_short_for_a_segment_has_no_score() -> None:
    drift = segment_drift(straight(50), straight(50))
    assert len(drift) == 0
    assert isnan(drift.translation_share)
    assert isnan(SegmentDrift.pool(()).rotation_per_metre)


def test_a_standing_sensor_has_an_end_error_but_no_share() -> None:
    true = straight(5, scale=0.0)
    told = true.copy()
    told[4, 1, 3] = 0.2
    drift = end_drift(told, true)
    assert drift.errors.translation_m[0] == pytest.approx(0.2)
    assert isnan(drift.translation_share)
    assert end_drift(true[:1], true[:1]).errors.translation_m[0] == 0.0


def test_pooled_drives_are_all_their_segments() -> None:
    short = segment_drift(straight(150, 1.1), straight(150))
    long = segment_drift(straight(300), straight(300))
    pooled = SegmentDrift.pool([short, long])
    assert len(pooled) == len(short) + len(long)
    expected = short.translation_share * len(short) / len(pooled)
    assert pooled.translation_share == pytest.approx(expected)
