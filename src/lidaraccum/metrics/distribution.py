"""How distances are distributed, in fixed fine bins: windows pool without keeping their points.

A bin is 0.5 % wide from 0.1 mm to 1 km, so a quantile read from it is within 0.25 % of the exact
one, or 0.05 mm where that is more, and a distribution of any number of points takes 26 kB.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil, floor, inf, nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.metrics.averages import ratios

FINEST_M = 1e-4
"""Below this, a tenth of a millimetre, distances share one bin."""
COARSEST_M = 1e3
"""From here on distances share one bin."""
BIN_RATIO = 1.005
"""Upper over lower edge of a bin, at most."""

EDGES_M = np.concatenate(
    [
        [0.0],
        np.geomspace(
            FINEST_M, COARSEST_M, 1 + ceil(np.log(COARSEST_M / FINEST_M) / np.log(BIN_RATIO))
        ),
        [inf],
    ]
)
"""(B + 1,) edges of the bins, metres; bin b holds ``EDGES_M[b] <= distance < EDGES_M[b + 1]``."""

_CENTRES_M = (EDGES_M[:-1] + EDGES_M[1:]) / 2


def shares_below(distances: NDArray[Any], at: NDArray[Any]) -> NDArray[np.float64]:
    """Empirical cumulative distribution of distances (N,) at places (K,), exact.

    Source: the paper's supplement, "ECDF": the share of samples strictly below the place. (K,)
    in 0..1, NaN when there is no sample.
    """
    below = np.searchsorted(np.sort(distances), at, side="left")
    return ratios(below, float(len(distances)))


@dataclass(frozen=True, eq=False)
class DistanceDistribution:
    """Distances counted in the bins of `EDGES_M`.

    Attributes:
        counts: (B,) int64: distances in each bin.
        smallest: Smallest distance, metres, exact; inf when there is none.
        largest: Largest distance, metres, exact; -inf when there is none.
    """

    counts: NDArray[np.int64]
    smallest: float
    largest: float

    @classmethod
    def of(cls, distances: NDArray[Any]) -> DistanceDistribution:
        """Count distances (N,), metres.

        Raises:
            InputError: A distance is negative or NaN.
        """
        distances = np.asarray(distances, dtype=np.float64)
        if not (distances >= 0).all():
            raise InputError("distances must be zero or more, and not NaN")
        bins = np.searchsorted(EDGES_M, distances, side="right") - 1
        return cls(
            counts=np.bincount(np.minimum(bins, len(_CENTRES_M) - 1), minlength=len(_CENTRES_M)),
            smallest=float(distances.min(initial=inf)),
            largest=float(distances.max(initial=-inf)),
        )

    @classmethod
    def pool(cls, parts: Iterable[DistanceDistribution]) -> DistanceDistribution:
        """All distances of several distributions; no part at all gives an empty one."""
        return sum(parts, start=cls.of(np.zeros(0)))

    def __add__(self, other: DistanceDistribution) -> DistanceDistribution:
        return DistanceDistribution(
            self.counts + other.counts,
            min(self.smallest, other.smallest),
            max(self.largest, other.largest),
        )

    def __len__(self) -> int:
        return int(self.counts.sum())

    def quantile(self, share: float) -> float:
        """The distance below which a share (0..1) of the distances lies, metres.

        As ``numpy.quantile`` defines it, within 0.25 % or 0.05 mm, whichever is more (see the
        module's text); NaN when there is no distance. Beyond 1 km it says the largest distance.
        """
        if len(self) == 0:
            return nan
        place = share * (len(self) - 1)
        ranks = np.array([floor(place), ceil(place)])
        bins = np.searchsorted(np.cumsum(self.counts), ranks, side="right")
        lower, upper = np.clip(_CENTRES_M[bins], self.smallest, self.largest)
        return float(lower + (upper - lower) * (place - ranks[0]))

    @property
    def median(self) -> float:
        """Half of the distances are smaller, metres; bounds as in `quantile`."""
        return self.quantile(0.5)

    def shares_below(self, at: NDArray[Any]) -> NDArray[np.float64]:
        """Empirical cumulative distribution at places (K,), metres, up to 1 km; (K,) in 0..1.

        Exact at the edges of the bins, linear between: off by less than the share of points
        in the place's own bin. NaN when there is no distance.
        """
        shares = ratios(np.concatenate([[0], np.cumsum(self.counts[:-1])]), float(len(self)))
        return np.interp(at, EDGES_M[:-1], shares)
