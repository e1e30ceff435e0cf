"""Which points are one object through a window: weighted coverage, instance precision, recall."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.metrics.averages import ratio, ratios

IOU_THRESHOLDS = (0.5, 0.6, 0.7, 0.8, 0.9)
"""An instance is found when its IoU with one of the other side is above this. The paper,
supplement, figure "Spatio-temporal instance association"; none below 0.5, see `score`."""

IntArray = NDArray[np.integer[Any]]


@dataclass(frozen=True, eq=False)
class AssociationScore:
    """Instances of any number of windows; two added are the score of all windows of both.

    Attributes:
        windows: Windows scored.
        true_instances: Instances there are.
        predicted_instances: Instances that were said to be.
        true_points: Points of the true instances.
        covered_points: Those points, each weighted by its instance's best IoU.
        coverage_sum: Sum over windows of their own weighted coverage.
        covered_windows: Windows with any true instance: the terms of ``coverage_sum``.
        found: (5,) int64: pairs of a true and a predicted instance above each of
            `IOU_THRESHOLDS`.
    """

    windows: int
    true_instances: int
    predicted_instances: int
    true_points: int
    covered_points: float
    coverage_sum: float
    covered_windows: int
    found: NDArray[np.int64]

    @classmethod
    def pool(cls, parts: Iterable[AssociationScore]) -> AssociationScore:
        """All windows of several; no part at all gives a score of no windows."""
        nothing = np.zeros(len(IOU_THRESHOLDS), np.int64)
        return sum(parts, start=cls(0, 0, 0, 0, 0.0, 0.0, 0, nothing))

    def __add__(self, other: AssociationScore) -> AssociationScore:
        return AssociationScore(
            windows=self.windows + other.windows,
            true_instances=self.true_instances + other.true_instances,
            predicted_instances=self.predicted_instances + other.predicted_instances,
            true_points=self.true_points + other.true_points,
            covered_points=self.covered_points + other.covered_points,
            coverage_sum=self.coverage_sum + other.coverage_sum,
            covered_windows=self.covered_windows + other.covered_windows,
            found=self.found + other.found,
        )

    @property
    def weighted_coverage(self) -> float:
        """WCov = Σ n_i·max_j IoU / Σ n_i over all true instances, 0..1; NaN when there is none.

        The paper's equation divides by the number of instances besides, by a slip: a perfect
        answer would then score 1 / their number.
        """
        return ratio(self.covered_points, self.true_points)

    @property
    def mean_weighted_coverage(self) -> float:
        """Mean over the windows of WCov, as the authors' code pools it (mWCov); NaN when none."""
        return ratio(self.coverage_sum, self.covered_windows)

    @property
    def precision(self) -> NDArray[np.float64]:
        """(5,) share of predicted instances that are one; NaN when none was predicted."""
        return ratios(self.found, self.predicted_instances)

    @property
    def recall(self) -> NDArray[np.float64]:
        """(5,) share of true instances that were found; NaN when there is none."""
        return ratios(self.found, self.true_instances)


def score(predicted: IntArray, truth: IntArray) -> AssociationScore:
    """Score instance ids (N,) of all frames' points of one window together, 0 for none.

    An IoU above 0.5 pairs at most one predicted with one true instance, so the pairs above a
    threshold count what was found on both sides, and no matching is to be chosen.

    Raises:
        InputError: The ids are not integers of one length, or negative (a clustering's noise).
    """
    for name, ids in (("predicted", predicted), ("true", truth)):
        if ids.ndim != 1 or not np.issubdtype(ids.dtype, np.integer):
            raise InputError(f"{name} instances must be (N,) integers, not {ids.shape} {ids.dtype}")
        if len(ids) and ids.min() < 0:
            raise InputError(f"{name} instances must be 0 for none, not {ids.min()}")
    if predicted.shape != truth.shape:
        raise InputError(f"{len(predicted)} predicted and {len(truth)} true instances")
    overlaps = _overlaps(predicted, truth)
    best = np.zeros(len(overlaps.true_sizes))
    np.maximum.at(best, overlaps.true_row, overlaps.iou)
    covered = float(overlaps.true_sizes @ best)
    true_points = int(overlaps.true_sizes.sum())
    return AssociationScore(
        windows=1,
        true_instances=len(overlaps.true_sizes),
        predicted_instances=overlaps.predicted_count,
        true_points=true_points,
        covered_points=covered,
        coverage_sum=covered / true_points if true_points else 0.0,
        covered_windows=int(true_points > 0),
        found=np.array([np.count_nonzero(overlaps.iou > least) for least in IOU_THRESHOLDS]),
    )


@dataclass(frozen=True, eq=False)
class _Overlaps:
    """K pairs of a true and a predicted instance that share points.

    Attributes:
        true_sizes: (G,) points of each true instance.
        predicted_count: Number of predicted instances.
        true_row: (K,) index into ``true_sizes``.
        iou: (K,) points shared over points of either.
    """

    true_sizes: NDArray[np.int64]
    predicted_count: int
    true_row: NDArray[np.int64]
    iou: NDArray[np.float64]


def _overlaps(predicted: IntArray, truth: IntArray) -> _Overlaps:
    # Id 0 is put in front on both sides, so that row and column 0 are always "none".
    true_ids, true_row = np.unique(np.append(0, truth), return_inverse=True)
    predicted_ids, predicted_row = np.unique(np.append(0, predicted), return_inverse=True)
    true_sizes = np.bincount(true_row[1:], minlength=len(true_ids))
    predicted_sizes = np.bincount(predicted_row[1:], minlength=len(predicted_ids))
    cells = true_row[1:] * len(predicted_ids) + predicted_row[1:]
    pairs, shared = np.unique(cells, return_counts=True)
    row, column = np.divmod(pairs, len(predicted_ids))
    real = (row > 0) & (column > 0)
    row, column, shared = row[real], column[real], shared[real]
    return _Overlaps(
        true_sizes=true_sizes[1:],
        predicted_count=len(predicted_ids) - 1,
        true_row=row - 1,
        iou=shared / (true_sizes[row] + predicted_sizes[column] - shared),
    )


def keep_majority(instance: IntArray, member: NDArray[np.bool_]) -> IntArray:
    """Only the instances (N,) of which more than half the points are members (N,) bool; else 0.

    With the true motion labels as members it cuts either side down to moving instances, as the
    authors' code does before it scores moving and still ones apart; the rest are the still ones.
    """
    if instance.shape != member.shape:
        raise InputError(f"instance is {instance.shape}, member {member.shape}")
    _, row = np.unique(instance, return_inverse=True)
    keep = np.bincount(row, member) * 2 > np.bincount(row)
    return np.where(keep[row], instance, 0)
