"""Parts add up to the whole, and each point is in the one it belongs to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.accumulation import MOVING, STILL
from lidaraccum.data.window import Window
from lidaraccum.evaluation.parts import PARTINGS, PartScore, added, score_parts
from lidaraccum.evaluation.truth import Scope, WindowTruth, window_truth


@pytest.fixture
def truth(hand_made: Any) -> WindowTruth:
    return window_truth(Window(hand_made, 0, 3), Scope(half_width_m=0))


@pytest.mark.parametrize("kind", sorted(PARTINGS))
def test_all_parts_together_are_everything(placed: Any, truth: WindowTruth, kind: str) -> None:
    parts = score_parts(placed(truth, 0.2), truth, 0, "HDL-64E")[kind]
    whole = sum(parts.values(), start=PartScore())
    # Three frames of two points of a car, two of a walker's one.
    assert (whole.moving, whole.found, whole.alarms) == (8, 8, 0)
    assert (whole.movable, whole.named) == (8, 8)
    assert whole.dynamic_points == 4
    assert whole.dynamic_epe_m == pytest.approx(0.2)
    if kind != "object speed":
        assert whole.static_points == 6
        assert whole.static_epe_m == pytest.approx(0.2)


def test_each_point_is_in_the_part_it_belongs_to(placed: Any, truth: WindowTruth) -> None:
    frames = [replace(frame, label=np.minimum(frame.label, STILL)) for frame in placed(truth)]
    parts = score_parts(frames, truth, 0, "HDL-64E")
    assert list(parts["kind"]) == ["background", "car", "pedestrian"]
    car, walker = parts["kind"]["car"], parts["kind"]["pedestrian"]
    assert (car.moving, walker.moving) == (6, 2)
    assert car.recall == walker.recall == 0.0
    assert car.foreground_recall == 1.0
    assert parts["object speed"]["from 20 m/s"].moving == 6
    assert parts["object speed"]["1 to 2 m/s"].moving == 2
    assert list(parts["ego speed"]) == ["10 to 15 m/s"]
    assert list(parts["sensor"]) == ["HDL-64E"]
    assert parts["range"]["30 to 40 m"].static_points == 2
    assert "from 40 m" not in parts["range"], "only the target has a point there"


def test_what_is_wrongly_called_moving_is_an_alarm_where_it_is(
    placed: Any, truth: WindowTruth
) -> None:
    frames = placed(truth)
    frames = [replace(frame, label=np.full_like(frame.label, MOVING)) for frame in frames]
    parts = score_parts(frames, truth, 0, "")
    assert parts["kind"]["background"].alarms == 9
    assert parts["kind"]["background"].precision == 0.0
    assert parts["kind"]["car"].precision == 1.0
    assert list(parts["sensor"]) == ["not told"]


def test_windows_of_two_sensors_are_kept_apart(placed: Any, truth: WindowTruth) -> None:
    frames = placed(truth)
    parts = added(score_parts(frames, truth, 0, name) for name in ("VLP-16", "OS1-64", "VLP-16"))
    assert {name: part.moving for name, part in parts["sensor"].items()} == {
        "OS1-64": 8,
        "VLP-16": 16,
    }
    assert (
        parts["range"]["5 to 10 m"].moving
        == 3 * score_parts(frames, truth, 0, "")["range"]["5 to 10 m"].moving
    )
