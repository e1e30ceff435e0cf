"""A misjudged ground moves heights, alike for all frames but for a little, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from lidaraccum.geometry import rigid
from lidaraccum.training.dataset import cut_windows
from lidaraccum.training.ground_error import BETWEEN_FRAMES, misjudge_ground
from lidaraccum.training.truth import window_of
from lidaraccum.training.window import TrainingWindow

ERROR_M = 0.1


@pytest.fixture
def window(toy: ModuleType) -> TrainingWindow:
    return window_of(toy.CarPark(0), range(4), toy.SMALL, toy.WINDOWS.extent_m)


def errors(before: TrainingWindow, after: TrainingWindow) -> list[np.ndarray]:
    """What was added to each frame's heights."""
    pairs = zip(before.frames, after.frames, strict=True)
    return [one.height.astype(float) - other.height for other, one in pairs]


def test_heights_alone_change(window: TrainingWindow) -> None:
    after = misjudge_ground(window, ERROR_M, np.random.default_rng(0))
    for frame, other in zip(window.frames, after.frames, strict=True):
        assert replace(other, height=frame.height).points is frame.points
        np.testing.assert_array_equal(other.cell, frame.cell)
        assert other.height.dtype == frame.height.dtype
    assert after.truth is window.truth
    assert max(np.abs(error).max() for error in errors(window, after)) > 0.01


def test_the_error_is_as_large_as_asked(window: TrainingWindow) -> None:
    drawn = [misjudge_ground(window, ERROR_M, np.random.default_rng(seed)) for seed in range(300)]
    lifts = [errors(window, after)[0][0] for after in drawn]
    # One number, two waves of which a place sees half the variance each, and the frame's own.
    assert np.std(lifts) == pytest.approx(ERROR_M * np.sqrt(2 + BETWEEN_FRAMES**2), rel=0.15)
    unchanged = misjudge_ground(window, 0.0, np.random.default_rng(0))
    assert not np.concatenate(errors(window, unchanged)).any()


def test_all_frames_err_alike_at_a_place(window: TrainingWindow) -> None:
    after = misjudge_ground(window, ERROR_M, np.random.default_rng(4))
    told = errors(window, after)
    places = [
        rigid.transform(pose @ rigid.invert(frame.level_from_sensor), frame.points)[:, :2]
        for frame, pose in zip(window.frames, window.target_from_sensor, strict=True)
    ]
    for place, error in zip(places[1:], told[1:], strict=True):
        away = np.linalg.norm(place[:, None] - places[0][None], axis=2)
        near = away.argmin(axis=1)
        close = away[np.arange(len(near)), near] < 0.3
        between = error[close] - told[0][near[close]]
        assert close.sum() > 100
        assert np.std(between) < 0.3 * ERROR_M  # a number of the frame's own, and 30 cm of way
        assert np.std(error) > 0.5 * np.std(told[0])


def test_windows_are_cut_with_it(toy: ModuleType) -> None:
    exact = toy.WINDOWS
    wrong = replace(exact, augment=replace(exact.augment, ground_m=ERROR_M))
    cut = [
        cut_windows(toy.CarPark(0), toy.SMALL, settings, np.random.default_rng(1))[0]
        for settings in (exact, wrong)
    ]
    assert np.std(errors(*cut)[0]) > 0.01
