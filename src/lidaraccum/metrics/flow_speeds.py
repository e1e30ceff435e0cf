"""Scene flow by speed and category: the bucket-normalised EPE.

A pedestrian lost at 1 m/s and a car lost at 10 m/s are both lost entirely; plain EPE says 10 cm
and 1 m. So errors are gathered per category and speed, and divided by the way gone.
Source: Khatri, Vedder et al., "I Can't Believe It's Not Scene Flow!" (ECCV 2024), the score of
the Argoverse 2 challenge of 2024.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.metrics.averages import mean_of_known, ratios
from lidaraccum.metrics.flow import FlowErrors

SPEED_EDGES_MPS = np.concatenate([np.linspace(0.0, 20.0, 51), [inf]])
"""(52,) edges of 51 speed buckets: 50 of 0.4 m/s and one beyond 20 m/s; the first is the static
one (so "static" ends at 0.4 m/s here, at 0.5 m/s elsewhere)."""


@dataclass(frozen=True, eq=False)
class FlowBySpeed:
    """Sums of C categories and B speed buckets; two added are the sums of all points of both.

    Attributes:
        categories: C names.
        points: (C, B) int64: points.
        epe_sum: (C, B) float64, metres: sum of their errors.
        way_sum: (C, B) float64, metres: sum of the way each went over ground within its gap.
    """

    categories: tuple[str, ...]
    points: NDArray[np.int64]
    epe_sum: NDArray[np.float64]
    way_sum: NDArray[np.float64]

    @classmethod
    def pool(cls, parts: Iterable[FlowBySpeed], categories: tuple[str, ...]) -> FlowBySpeed:
        """All points of several; no part at all gives sums of no points."""
        shape = (len(categories), len(SPEED_EDGES_MPS) - 1)
        nothing = cls(categories, np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape))
        return sum(parts, start=nothing)

    def __add__(self, other: FlowBySpeed) -> FlowBySpeed:
        if self.categories != other.categories:
            raise InputError(f"categories differ: {self.categories} and {other.categories}")
        return FlowBySpeed(
            self.categories,
            self.points + other.points,
            self.epe_sum + other.epe_sum,
            self.way_sum + other.way_sum,
        )

    @property
    def static_epe(self) -> NDArray[np.float64]:
        """(C,) mean EPE in the static bucket, metres; NaN for a category without points in it."""
        return ratios(self.epe_sum[:, 0], self.points[:, 0])

    @property
    def normalised_epe(self) -> NDArray[np.float64]:
        """(C, B - 1) mean EPE over mean way in each moving bucket: 0 perfect, 1 as if all stood.

        NaN where a bucket has no points.
        """
        return ratios(self.epe_sum[:, 1:], self.way_sum[:, 1:])

    @property
    def dynamic_error(self) -> NDArray[np.float64]:
        """(C,) mean of `normalised_epe` over the buckets with points, each counting the same."""
        return np.array([mean_of_known(row) for row in self.normalised_epe])

    @property
    def mean_static_epe(self) -> float:
        """Mean of `static_epe` over the categories with points, metres; NaN when none has."""
        return mean_of_known(self.static_epe)

    @property
    def mean_dynamic_error(self) -> float:
        """The challenge's score: mean of `dynamic_error` over categories; NaN when none moves."""
        return mean_of_known(self.dynamic_error)


def summarise_by_speed(
    errors: FlowErrors,
    way_m: NDArray[Any],
    gap_s: NDArray[Any] | float,
    category: NDArray[Any],
    categories: tuple[str, ...],
) -> FlowBySpeed:
    """Sort errors of N points by category and true speed over ground.

    The source knows pairs 0.1 s apart only; for other gaps a bucket is still one of speeds, and
    errors are still divided by the way gone within the gap, so the two agree at 0.1 s.

    Args:
        errors: Of N points.
        way_m: (N,) metres: length of the true flow without ego-motion.
        gap_s: (N,) or one for all, seconds between the point's frame and the target; not zero.
        category: (N,) int: index into ``categories``.
        categories: C names; the challenge has background, car, other vehicles, pedestrian and
            wheeled road user.

    Raises:
        InputError: Lengths differ, a gap is zero, or a category has no name.
    """
    if not len(errors) == len(way_m) == len(category):
        raise InputError(f"{len(errors)} errors, {len(way_m)} ways, {len(category)} categories")
    gap_s = np.broadcast_to(np.abs(gap_s), way_m.shape)
    if not (gap_s > 0).all():
        raise InputError("a point of the target frame itself has no speed: gap is 0 s")
    if len(category) and not 0 <= category.min() <= category.max() < len(categories):
        raise InputError(f"category index {category.min()}..{category.max()}, {categories} given")
    buckets = len(SPEED_EDGES_MPS) - 1
    bucket = np.searchsorted(SPEED_EDGES_MPS, way_m / gap_s, side="right") - 1
    cell = category.astype(np.int64) * buckets + bucket

    def table(weights: NDArray[Any]) -> NDArray[np.float64]:
        sums = np.bincount(cell, weights, minlength=len(categories) * buckets)
        return sums.astype(np.float64).reshape(len(categories), buckets)

    return FlowBySpeed(
        categories=categories,
        points=table(np.ones(len(errors))).astype(np.int64),
        epe_sum=table(errors.epe),
        way_sum=table(way_m),
    )
