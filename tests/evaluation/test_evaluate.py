"""The whole evaluation: an oracle scores near nothing, all methods run, ego-only is the floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lidaraccum.errors import InputError, SettingsError
from lidaraccum.evaluation.baselines import METHODS
from lidaraccum.evaluation.evaluate import (
    EvaluationReport,
    EvaluationSettings,
    MethodReport,
    evaluate,
)
from lidaraccum.evaluation.truth import Scope
from lidaraccum.io.sequences import open_sequence
from lidaraccum.simulation.drive import DriveSettings, simulate

NAMES = tuple(method.name for method in METHODS)


def score(folder: Path, **changes: object) -> EvaluationReport:
    return evaluate([open_sequence(folder)], EvaluationSettings(**changes))  # type: ignore[arg-type]


def method(report: EvaluationReport, name: str) -> MethodReport:
    return next(one for one in report.methods if one.method.name == name)


@pytest.fixture(scope="module")
def given(street: Path) -> EvaluationReport:
    return score(street, methods=("ego-only", "oracle"), given_poses=True)


@pytest.fixture(scope="module")
def estimated(street: Path) -> EvaluationReport:
    return score(street, methods=NAMES)


@pytest.mark.parametrize("target", ["first", "middle", "last"])
def test_the_oracle_puts_every_point_where_it_belongs(street: Path, target: str) -> None:
    report = score(street, methods=("oracle",), given_poses=True, target=target, scope=Scope(0))
    scores = report.methods[0].scores
    assert scores.flow.dynamic.points > 100
    assert scores.flow.static.distribution.largest < 1e-3
    assert scores.flow.dynamic.distribution.largest < 1e-3
    assert scores.motion.iou == scores.foreground.iou == 1.0
    assert scores.association.weighted_coverage == 1.0


def test_ego_only_moves_what_stands_and_loses_what_moves(given: EvaluationReport) -> None:
    scores = method(given, "ego-only").scores
    assert scores.flow.static_background.epe_mean < 1e-4
    assert scores.flow.dynamic.epe_mean > 0.1
    assert scores.motion.recall == 0.0


def test_estimated_poses_are_right_to_centimetres(estimated: EvaluationReport) -> None:
    scores = method(estimated, "oracle").scores
    assert 0 < scores.absolute.translation.mean < 0.05
    assert scores.flow.static.epe_mean < 0.05


def test_every_baseline_runs_and_those_told_of_movers_beat_standing_still(
    estimated: EvaluationReport,
) -> None:
    still = method(estimated, "ego-only").scores.flow.dynamic.epe_mean
    for name in ("center", "center-icp", "kalman", "oracle"):
        scores = method(estimated, name).scores
        assert scores.flow.dynamic.epe_mean < still, name
        assert scores.motion.iou == 1.0, name
    assert {one.scores.flow.static.points for one in estimated.methods} == {
        method(estimated, "oracle").scores.flow.static.points
    }


def test_further_lengths_are_scored_on_the_same_starts(street: Path) -> None:
    report = score(street, methods=("ego-only",), length=3, lengths=(2, 3), stride=3)
    one = report.methods[0]
    assert sorted(one.by_length) == [2, 3]
    assert one.by_length[3].windows == one.scores.windows == 2
    assert one.by_length[2].windows == 2


def test_sequences_of_one_name_stay_two_scenes(street: Path) -> None:
    settings = EvaluationSettings(length=2, stride=4, given_poses=True)
    twice = evaluate([open_sequence(street), open_sequence(street)], settings)
    assert [scene.scores.windows for scene in twice.methods[0].scenes] == [2, 2]


def test_too_few_frames_unknown_methods_and_odd_numbers_are_refused(street: Path) -> None:
    with pytest.raises(InputError, match="7 frames"):
        score(street, length=7)
    with pytest.raises(SettingsError, match="ego-only"):
        EvaluationSettings(methods=("magic",))
    for changes in ({"length": 1}, {"stride": -1}, {"target": "best"}):
        with pytest.raises(SettingsError):
            EvaluationSettings(**changes)  # type: ignore[arg-type]


def test_a_rolling_shutter_is_scored_against_where_points_were_at_the_stamp() -> None:
    common = {"seed": 8, "frames": 2, "sensor": "VLP-16", "speed_mps": 9.0, "exact": True}
    rolling = simulate(DriveSettings(**common, rolling_shutter=True, compensated=False))  # type: ignore[arg-type]
    compensated = simulate(DriveSettings(**common, rolling_shutter=True, compensated=True))  # type: ignore[arg-type]
    measured, undone = rolling[1].points, compensated[1].points
    places = rolling.labels(1).points_at_stamp
    assert places is not None
    still = rolling.labels(1).instance == 0
    assert np.abs(measured - places)[still].max() > 0.1
    np.testing.assert_allclose(places[still], undone[still], atol=1e-4)
    np.testing.assert_allclose(places, compensated.labels(1).points_at_stamp, atol=1e-4)
    assert np.abs(places - undone)[~still].max() > 0.02
