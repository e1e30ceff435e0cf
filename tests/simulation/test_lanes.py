"""Vehicles in a lane keep apart and never roll back."""

from __future__ import annotations

import numpy as np

from lidaraccum.simulation.lanes import Column, drive_column
from lidaraccum.simulation.motion import MANOEUVRES, distance_of, sample_times, speed_profile


def column(speed: float) -> Column:
    start = np.array([100.0, 80.0, 55.0, 20.0])
    return Column(
        start, np.full(4, speed), np.array([9.0, 15.0, 12.0, 14.0]), np.full(4, 4.5),
        np.full(4, 1.0), np.zeros(4),
    )  # fmt: skip


def test_nobody_runs_into_anyone_nor_rolls_back() -> None:
    times = sample_times(20.0)
    stops = np.minimum(130.0 + 8 * np.clip(times, 0, None), 170.0)
    for speed in (0.0, 6.0, 12.0):
        track = drive_column(column(speed), times, stops, 4.5)
        assert (np.diff(track, axis=0) >= 0).all()
        gaps = np.diff(np.column_stack([stops, track]), axis=1)
        assert (gaps < -4.5).all()


def test_followers_reach_the_pace_of_the_one_ahead() -> None:
    times = sample_times(30.0)
    track = drive_column(column(3.0), times, None, 0.0)
    pace = (track[-1] - track[-21]) / (times[-1] - times[-21])
    assert np.allclose(pace, 9.0, atol=0.6)


def test_speeds_never_fall_below_zero_nor_above_the_limit() -> None:
    times, rng = sample_times(10.0), np.random.default_rng(0)
    for manoeuvre in MANOEUVRES:
        for _ in range(20):
            speeds = speed_profile(times, 10.0, manoeuvre, rng, 14.0)
            assert speeds.min() >= 0.0
            assert speeds.max() <= 14.0
            assert (np.diff(distance_of(times, speeds)) >= 0).all()
