"""Scene flow: end-point errors per point, and the paper's scores of them.

A flow takes a point from where it was measured, in its own frame's sensor coordinates, to where it
belongs in the target frame: ego-motion included, so a static point's flow is not zero. Errors are
made per window (`flow_errors`), cut down to what is scored (`FlowErrors.select`), summarised, and
the summaries added up; a summary has the size of a histogram, whatever the number of points.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.metrics.averages import ratio
from lidaraccum.metrics.distribution import DistanceDistribution

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Threshold:
    """An absolute bound in metres and one relative to the length of the true flow."""

    epe_m: float
    relative: float


STRICT = Threshold(0.05, 0.05)
"""AccS: closer than 5 cm or 5 %. Liu et al., FlowNet3D (CVPR 2019); the paper, section 4.1."""
RELAXED = Threshold(0.10, 0.10)
"""AccR: closer than 10 cm or 10 %. Same sources."""
OUTLIER = Threshold(0.30, 0.10)
"""Outlier: more than 30 cm or more than 10 % off. Same sources."""
ROBUST_OUTLIER = Threshold(0.30, 0.30)
"""ROutlier: more than 30 cm and more than 30 % off. Baur et al., SLIM (ICCV 2021)."""

SQUARE_HALF_WIDTH_M = 32.0
"""The paper scores the 64 x 64 m square about the sensor (section 4.1, "Metrics")."""


def inside_square(
    positions_target: NDArray[Any], half_width_m: float = SQUARE_HALF_WIDTH_M
) -> BoolArray:
    """Which positions (N, 3), target frame's sensor coordinates, lie in the scored square; (N,).

    Positions are the true ones (points plus true flow), as the paper has it: the square "in the
    target frame". The authors' code crops each point by its place in its own frame instead.
    """
    return np.all(np.abs(positions_target[:, :2]) < half_width_m, axis=1)


def flow_errors(predicted_flow: NDArray[Any], true_flow: NDArray[Any]) -> FlowErrors:
    """End-point error of each point, from flows (N, 3), metres, in the target frame's axes.

    Raises:
        InputError: The flows differ in shape, or are not finite.
    """
    predicted_flow = np.asarray(predicted_flow, dtype=np.float64)
    true_flow = np.asarray(true_flow, dtype=np.float64)
    if predicted_flow.shape != true_flow.shape or true_flow.shape[1:] != (3,):
        raise InputError(f"flows must be (N, 3): {predicted_flow.shape} and {true_flow.shape}")
    if not (np.isfinite(predicted_flow).all() and np.isfinite(true_flow).all()):
        raise InputError("flows must be finite")
    return FlowErrors(
        epe=np.linalg.norm(predicted_flow - true_flow, axis=1),
        true_length=np.linalg.norm(true_flow, axis=1),
    )


@dataclass(frozen=True, eq=False)
class FlowErrors:
    """The errors of one window's source points.

    Attributes:
        epe: (N,) float64, metres: ‖flow - true flow‖.
        true_length: (N,) float64, metres: ‖true flow‖, ego-motion included.
    """

    epe: NDArray[np.float64]
    true_length: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.epe.ndim != 1 or self.epe.shape != self.true_length.shape:
            raise InputError(f"epe is {self.epe.shape}, true_length {self.true_length.shape}")

    def __len__(self) -> int:
        return len(self.epe)

    @property
    def relative(self) -> NDArray[np.float64]:
        """(N,) error over the length of the true flow.

        Where the truth does not move at all: 0 for no error, else inf. So every error under a
        standing sensor is an `OUTLIER`, as in the authors' code; read ROutlier there.
        """
        still = self.true_length == 0
        share = np.where(self.epe == 0, 0.0, np.inf)
        return np.divide(self.epe, self.true_length, out=share, where=~still)

    def select(self, keep: BoolArray) -> FlowErrors:
        """Only the points where ``keep`` (N,) bool is True."""
        return FlowErrors(self.epe[keep], self.true_length[keep])

    def summary(self) -> FlowSummary:
        """What the scores are made of."""
        epe, relative = self.epe, self.relative
        outlier, robust = OUTLIER, ROBUST_OUTLIER
        return FlowSummary(
            points=len(epe),
            epe_sum=float(epe.sum()),
            strict=_within(epe, relative, STRICT),
            relaxed=_within(epe, relative, RELAXED),
            outliers=_count((epe > outlier.epe_m) | (relative > outlier.relative)),
            robust_outliers=_count((epe > robust.epe_m) & (relative > robust.relative)),
            distribution=DistanceDistribution.of(epe),
        )


def _count(mask: BoolArray) -> int:
    return int(np.count_nonzero(mask))


def _within(epe: NDArray[Any], relative: NDArray[Any], threshold: Threshold) -> int:
    return _count((epe < threshold.epe_m) | (relative < threshold.relative))


@dataclass(frozen=True, eq=False)
class FlowSummary:
    """Scores of any number of points; two added are the scores of all points of both.

    A score of no points is NaN: there was nothing to score (no dynamic points in the window, say).
    Shares are 0..1. The authors' code pools dynamic points in half precision, on Waymo every
    fourth, and averages medians over scenes; here every point counts once.

    Attributes:
        points: Points scored.
        epe_sum: Sum of their errors, metres.
        strict: Points within `STRICT`.
        relaxed: Points within `RELAXED`.
        outliers: Points beyond `OUTLIER`.
        robust_outliers: Points beyond `ROBUST_OUTLIER`.
        distribution: Of the errors.
    """

    points: int
    epe_sum: float
    strict: int
    relaxed: int
    outliers: int
    robust_outliers: int
    distribution: DistanceDistribution

    @classmethod
    def pool(cls, parts: Iterable[FlowSummary]) -> FlowSummary:
        """All points of several summaries; no part at all gives a summary of no points."""
        return sum(parts, start=FlowErrors(np.zeros(0), np.zeros(0)).summary())

    def __add__(self, other: FlowSummary) -> FlowSummary:
        return FlowSummary(
            points=self.points + other.points,
            epe_sum=self.epe_sum + other.epe_sum,
            strict=self.strict + other.strict,
            relaxed=self.relaxed + other.relaxed,
            outliers=self.outliers + other.outliers,
            robust_outliers=self.robust_outliers + other.robust_outliers,
            distribution=self.distribution + other.distribution,
        )

    @property
    def epe_mean(self) -> float:
        """EPE avg., metres."""
        return ratio(self.epe_sum, self.points)

    @property
    def epe_median(self) -> float:
        """EPE med., metres, within 0.25 % or 0.05 mm (see `DistanceDistribution.quantile`)."""
        return self.distribution.median

    @property
    def acc_strict(self) -> float:
        """AccS: share of points within `STRICT`."""
        return ratio(self.strict, self.points)

    @property
    def acc_relaxed(self) -> float:
        """AccR: share of points within `RELAXED`."""
        return ratio(self.relaxed, self.points)

    @property
    def outlier(self) -> float:
        """Outlier: share of points beyond `OUTLIER`."""
        return ratio(self.outliers, self.points)

    @property
    def robust_outlier(self) -> float:
        """ROutlier: share of points beyond `ROBUST_OUTLIER`."""
        return ratio(self.robust_outliers, self.points)
