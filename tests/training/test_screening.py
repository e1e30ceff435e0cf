"""Screening: what each factor does is told apart from what all others do."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from lidaraccum.errors import SettingsError
from lidaraccum.training.screening import SPARE, Screening, plackett_burman


@pytest.mark.parametrize("prime", [7, 11, 19, 23, 31, 43, 47])
def test_any_two_factors_meet_in_all_four_ways_equally_often(prime: int) -> None:
    high = plackett_burman(prime)
    assert high.shape == (prime + 1, prime)
    for one, other in combinations(high.T, 2):
        met = np.bincount(2 * one + other, minlength=4)
        assert (met == (prime + 1) // 4).all()


def test_effects_that_add_up_are_found_whatever_the_others_do() -> None:
    names = [f"factor {place}" for place in range(17)]
    screening = Screening.of(names)
    rng = np.random.default_rng(3)
    true = rng.normal(0, 1, len(names))
    values = 5.0 + screening.high[:, : len(names)] @ true
    effects, _ = screening.effects(values)
    assert effects == pytest.approx(true)


def test_chance_is_told_as_large_as_it_is() -> None:
    """The error of an effect is twice the noise of a run over the root of their number."""
    screening = Screening.of([f"factor {place}" for place in range(8)])
    noise = np.random.default_rng(4).normal(0, 1, (4000, len(screening.runs)))
    found = [screening.effects(values) for values in noise]
    spread = np.std([effects for effects, _ in found])
    told = np.mean([chance for _, chance in found])
    expected = 2.0 / np.sqrt(len(screening.runs))
    assert spread == pytest.approx(expected, rel=0.03)
    assert told == pytest.approx(expected, rel=0.15)


def test_what_does_a_lot_is_not_taken_for_chance() -> None:
    screening = Screening.of([f"factor {place}" for place in range(16)])
    noise = np.random.default_rng(5).normal(0, 1, len(screening.runs))
    large = noise + 50.0 * screening.high[:, 2] - 30.0 * screening.high[:, 9]
    effects, chance = screening.effects(large)
    assert (effects[2], effects[9]) == pytest.approx((50.0, -30.0), abs=2.0)
    assert chance < 2.0


def test_nothing_is_told_before_every_run_has_a_value() -> None:
    screening = Screening.of(["one", "two"])
    values = np.ones(len(screening.runs))
    values[-1] = np.nan
    effects, chance = screening.effects(values)
    assert np.isnan([*effects, chance]).all()


@pytest.mark.parametrize("count", [1, 4, 5, 8, 16, 20, 44])
def test_a_design_is_no_larger_than_it_must_be(count: int) -> None:
    screening = Screening.of([str(place) for place in range(count)])
    runs, columns = screening.high.shape
    assert runs == len(screening.runs) == len(set(screening.runs)) == columns + 1
    assert columns >= count + SPARE
    assert runs <= 2 * (count + SPARE) + 2


def test_what_cannot_be_screened_is_refused() -> None:
    with pytest.raises(SettingsError, match="one name"):
        Screening.of(["one", "one"])
    with pytest.raises(SettingsError, match="44 factors at most"):
        Screening.of([str(place) for place in range(45)])
