"""What holds the sensor carries it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.evaluation.evaluate import EvaluationSettings, evaluate
from lidaraccum.evaluation.scores import Scores
from lidaraccum.model.weights import shipped_weights
from lidaraccum.pipeline.carrier import surrounds
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.windows import held_out_settings


def outline(length: float, width: float, *, ahead: float, left: float) -> NDArray[np.float64]:
    """Points (N, 3) on all sides of a level box whose middle is so far from the sensor, metres."""
    step = np.linspace(-0.5, 0.5, 200)
    edge = np.full_like(step, 0.5)
    sides = [(step, edge), (step, -edge), (edge, step), (-edge, step)]
    flat = np.concatenate([np.stack(side, axis=1) for side in sides]) * (length, width)
    flat += np.array([ahead, left])
    return np.column_stack([flat, np.ones(len(flat))])


@pytest.mark.parametrize("ahead", [-1.5, 0.0, 2.0])
def test_a_body_about_the_sensor_surrounds_it(ahead: float) -> None:
    assert surrounds(outline(8.0, 3.0, ahead=ahead, left=0.5))


@pytest.mark.parametrize("left", [-3.0, 1.4, 2.5])
@pytest.mark.parametrize("ahead", [-6.0, 0.0, 6.0])
def test_a_bus_beside_the_sensor_does_not(ahead: float, left: float) -> None:
    assert not surrounds(outline(12.0, 2.5, ahead=ahead, left=left))


def test_a_few_strays_on_the_other_side_do_not_count() -> None:
    bus = outline(12.0, 2.5, ahead=0.0, left=2.5)
    strays = np.array([[-1.0, -3.0, 0.0], [0.0, -3.0, 0.0], [1.0, -3.0, 0.0]])
    assert not surrounds(np.concatenate([bus, strays]))


def test_rails_on_both_sides_do_not_go_along_with_the_carrier() -> None:
    """At 30 m/s what beams meet of two rails and the own bonnet stays where the sensor is."""
    settings = EvaluationSettings(methods=("network",), weights=shipped_weights())
    (network,) = evaluate([simulate(held_out_settings(155, 5))], settings).methods
    assert network.scores.motion.false_positive == 0
    assert network.scores.flow.static.epe_mean < 0.03


@pytest.fixture(scope="module")
def followed() -> Scores:
    """Of a car that keeps pace behind, between parked cars on both sides."""
    settings = EvaluationSettings(methods=("network",), weights=shipped_weights())
    (network,) = evaluate([simulate(held_out_settings(10, 5))], settings).methods
    return network.scores


def test_a_car_that_keeps_pace_behind_does_not_go_with_the_carrier(followed: Scores) -> None:
    """What beams meet of the road about the sensor was joined with it, and both dropped."""
    assert followed.motion.recall > 0.95
    assert followed.flow.dynamic.epe_mean < 0.1


def test_parked_cars_on_both_sides_do_not_turn_about_the_carrier(followed: Scores) -> None:
    """Taken for one thing, by a proposer who has its way wrong, they are wider than a vehicle."""
    assert followed.motion.precision > 0.85
