"""Many questions in a few runs: each factor is low in half of them and high in the other half.

Plackett and Burman (The design of optimum multifactorial experiments, 1946): as each pair of
factors meets in all four ways equally often, the mean over the high runs less that over the low
ones is what a factor does, and every run tells about every factor. One factor after another would
need half as many runs for each of them to be as sure. What two factors do together is not seen,
and falls upon the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import SettingsError

SPARE = 3
"""Columns that no factor has, at least: what they seem to do is chance alone."""

_PRIMES = (7, 11, 19, 23, 31, 43, 47)
"""Of the form 4 k - 1; a design has one run more."""


@dataclass(frozen=True)
class Factor:
    """A question: what is set over the base when it is low, and when it is high.

    Attributes:
        name: In tables.
        low: Settings, as tables of a TOML file.
        high: Likewise.
    """

    name: str
    low: Mapping[str, Any]
    high: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Screening:
    """Which factor is high in which run.

    Attributes:
        factors: Names, for the first columns.
        runs: A recipe's name each.
        high: (R, C) bool, a row a run; columns beyond the factors' are nobody's.
    """

    factors: tuple[str, ...]
    runs: tuple[str, ...]
    high: NDArray[np.bool_]

    @classmethod
    def of(cls, factors: Sequence[str]) -> Screening:
        """The smallest design for these factors.

        Raises:
            SettingsError: There are too many, or two share a name.
        """
        if len(set(factors)) < len(factors):
            raise SettingsError("two factors have one name")
        wanted = len(factors) + SPARE
        prime = next((prime for prime in _PRIMES if prime >= wanted), None)
        if prime is None:
            raise SettingsError(f"{_PRIMES[-1] - SPARE} factors at most, not {len(factors)}")
        high = plackett_burman(prime)
        return cls(tuple(factors), tuple(f"run-{row + 1:02d}" for row in range(len(high))), high)

    def effects(self, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """What each factor does to a number, and how much of that may be chance.

        Args:
            values: (R,) of each run.

        Returns:
            (F,) mean of the high runs less that of the low ones, and one sigma of its error (Lenth,
            Quick and easy analysis of unreplicated factorials, 1989): most factors do little, so
            the usual size of all columns' effects is that of chance. NaN all, unless every run has
            a value.
        """
        sign = np.where(self.high, 1.0, -1.0)
        contrast = 2.0 / len(values) * sign.T @ values
        size = np.abs(contrast)
        small = size[size <= 2.5 * 1.5 * np.median(size)]
        chance = 1.5 * float(np.median(small)) if len(small) else np.nan
        return contrast[: len(self.factors)], chance


def plackett_burman(prime: int) -> NDArray[np.bool_]:
    """(prime + 1, prime) bool, for a prime of the form 4 k - 1: after Paley, by its squares."""
    squares = {i * i % prime for i in range(1, prime)}
    first = np.array([place == 0 or place in squares for place in range(prime)])
    rows = [np.roll(first, shift) for shift in range(prime)]
    return np.array([*rows, np.zeros(prime, bool)])
