"""Flow scores: hand-computed cases, and the laws that every score of points keeps."""

from __future__ import annotations

from math import isnan

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.metrics.flow import FlowErrors, FlowSummary, flow_errors, inside_square


def scores(summary: FlowSummary) -> NDArray[np.float64]:
    return np.array(
        [
            summary.epe_mean,
            summary.epe_median,
            summary.acc_strict,
            summary.acc_relaxed,
            summary.outlier,
            summary.robust_outlier,
        ]
    )


def random_errors(count: int, seed: int = 0) -> FlowErrors:
    random = np.random.default_rng(seed)
    true = random.normal(size=(count, 3))
    return flow_errors(true + random.normal(scale=0.2, size=(count, 3)), true)


def test_hand_computed_errors() -> None:
    true = np.array([[3.0, 0.0, 4.0], [0.0, 2.0, 0.0]])
    predicted = np.array([[3.0, 0.0, 3.0], [0.3, 2.4, 0.0]])
    errors = flow_errors(predicted, true)
    np.testing.assert_allclose(errors.epe, [1.0, 0.5])
    np.testing.assert_allclose(errors.true_length, [5.0, 2.0])
    np.testing.assert_allclose(errors.relative, [0.2, 0.25])


@pytest.mark.parametrize(
    ("epe", "length", "strict", "relaxed", "outlier", "robust"),
    [
        (0.04, 0.1, 1, 1, 1, 0),  # 4 cm of 10 cm: near enough, and an outlier by its 40 %
        (0.06, 2.0, 1, 1, 0, 0),  # 6 cm of 2 m: strict by its 3 %
        (0.06, 1.0, 0, 1, 0, 0),  # 6 cm of 1 m: 6 %
        (0.20, 1.5, 0, 0, 1, 0),  # 13 %
        (0.40, 10.0, 1, 1, 1, 0),  # 4 %, yet an outlier by its 40 cm
        (0.40, 1.0, 0, 0, 1, 1),  # 40 cm and 40 %
        (0.40, 1.5, 0, 0, 1, 0),  # 40 cm, but 27 %
        (0.25, 0.5, 0, 0, 1, 0),  # 50 %, but 25 cm
    ],
)
def test_hand_computed_scores(
    epe: float, length: float, strict: int, relaxed: int, outlier: int, robust: int
) -> None:
    summary = FlowErrors(np.array([epe]), np.array([length])).summary()
    found = (summary.acc_strict, summary.acc_relaxed, summary.outlier, summary.robust_outlier)
    assert found == (strict, relaxed, outlier, robust)


def test_a_bound_itself_is_neither_within_nor_beyond() -> None:
    on_strict = FlowErrors(np.array([0.05]), np.array([1.0])).summary()
    assert (on_strict.acc_strict, on_strict.acc_relaxed) == (0, 1)
    on_outlier = FlowErrors(np.array([0.3]), np.array([1000.0])).summary()
    assert on_outlier.outlier == 0


def test_a_perfect_prediction_is_perfect() -> None:
    true = np.random.default_rng(0).normal(size=(50, 3))
    true[:5] = 0.0
    np.testing.assert_array_equal(scores(flow_errors(true, true).summary()), [0, 0, 1, 1, 0, 0])


def test_the_error_over_no_flow_is_unbounded() -> None:
    errors = flow_errors(np.array([[0.01, 0.0, 0.0], [0.0, 0.0, 0.0]]), np.zeros((2, 3)))
    np.testing.assert_array_equal(errors.relative, [np.inf, 0.0])
    summary = errors.summary()
    assert (summary.acc_strict, summary.outlier, summary.robust_outlier) == (1.0, 0.5, 0.0)


def test_the_order_of_points_does_not_matter() -> None:
    errors = random_errors(1000)
    order = np.random.default_rng(1).permutation(1000)
    mixed = FlowErrors(errors.epe[order], errors.true_length[order])
    np.testing.assert_allclose(scores(mixed.summary()), scores(errors.summary()), rtol=1e-12)


def test_turning_the_world_does_not_matter() -> None:
    random = np.random.default_rng(2)
    true, predicted = random.normal(size=(2, 100, 3))
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    turned = flow_errors(predicted @ turn, true @ turn)
    np.testing.assert_allclose(turned.epe, flow_errors(predicted, true).epe)
    np.testing.assert_allclose(turned.true_length, np.linalg.norm(true, axis=1))


def test_pooled_windows_score_as_all_their_points_together() -> None:
    windows = [random_errors(count, seed=count) for count in (1, 10, 333)]
    pooled = FlowSummary.pool(window.summary() for window in windows)
    together = FlowErrors(
        np.concatenate([window.epe for window in windows]),
        np.concatenate([window.true_length for window in windows]),
    )
    assert pooled.points == 344
    np.testing.assert_allclose(scores(pooled), scores(together.summary()), rtol=1e-12)
    assert pooled.epe_mean == pytest.approx(together.epe.mean(), rel=1e-12)
    assert pooled.epe_median == pytest.approx(np.median(together.epe), rel=0.0025)


def test_selected_points_alone_are_scored() -> None:
    errors = FlowErrors(np.array([0.01, 5.0, 0.03]), np.ones(3))
    summary = errors.select(np.array([True, False, True])).summary()
    assert (summary.points, summary.epe_mean, summary.outlier) == (2, 0.02, 0.0)


def test_no_points_score_nothing() -> None:
    for summary in (
        FlowSummary.pool(()),
        flow_errors(np.zeros((0, 3)), np.zeros((0, 3))).summary(),
    ):
        assert summary.points == 0
        assert np.isnan(scores(summary)).all()
    one = random_errors(1).summary()
    np.testing.assert_array_equal(scores(one + FlowSummary.pool(())), scores(one))
    assert not isnan(one.epe_mean)


def test_float32_flows_are_compared_in_float64() -> None:
    true = np.full((1, 3), 50.0, dtype=np.float32)
    errors = flow_errors(true.astype(np.float64) + 1e-7, true)
    np.testing.assert_allclose(errors.epe, np.sqrt(3) * 1e-7, rtol=1e-6)


@pytest.mark.parametrize(
    ("predicted", "true"),
    [
        (np.zeros((2, 3)), np.zeros((3, 3))),
        (np.zeros((2, 2)), np.zeros((2, 2))),
        (np.full((1, 3), np.nan), np.zeros((1, 3))),
        (np.zeros((1, 3)), np.full((1, 3), np.inf)),
    ],
)
def test_what_is_no_flow_is_refused(
    predicted: NDArray[np.float64], true: NDArray[np.float64]
) -> None:
    with pytest.raises(InputError, match="flows"):
        flow_errors(predicted, true)
    with pytest.raises(InputError, match="true_length"):
        FlowErrors(np.zeros(2), np.zeros(3))


def test_the_square_is_about_the_sensor_and_has_no_height() -> None:
    places = np.array([[31.9, -31.9, 99.0], [32.0, 0.0, 0.0], [0.0, -32.1, 0.0], [0.0, 0.0, -9.0]])
    np.testing.assert_array_equal(inside_square(places), [True, False, False, True])
    assert not inside_square(places, half_width_m=10.0)[0]
