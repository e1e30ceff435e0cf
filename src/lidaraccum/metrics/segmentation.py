"""Two-class segmentation (moving or not, movable or not): precision, recall, IoU."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.metrics.averages import ratio

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class SegmentationCounts:
    """Points by what was said and what is true; two added are the counts of both.

    Source: the paper's section 4.1 (precision and recall of the dynamic parts); IoU is that of
    the positive class alone, as in the peers' tables.

    Attributes:
        true_positive: Said so, and is.
        false_positive: Said so, but is not.
        false_negative: Is, but was not said.
        true_negative: Neither.
    """

    true_positive: int = 0
    false_positive: int = 0
    false_negative: int = 0
    true_negative: int = 0

    @classmethod
    def pool(cls, parts: Iterable[SegmentationCounts]) -> SegmentationCounts:
        """All points of several; no part at all gives counts of no points."""
        return sum(parts, start=cls())

    def __add__(self, other: SegmentationCounts) -> SegmentationCounts:
        return SegmentationCounts(
            self.true_positive + other.true_positive,
            self.false_positive + other.false_positive,
            self.false_negative + other.false_negative,
            self.true_negative + other.true_negative,
        )

    @property
    def precision(self) -> float:
        """Share of what was said that is true, 0..1; NaN when nothing was said."""
        return ratio(self.true_positive, self.true_positive + self.false_positive)

    @property
    def recall(self) -> float:
        """Share of what is true that was said, 0..1; NaN when nothing is true."""
        return ratio(self.true_positive, self.true_positive + self.false_negative)

    @property
    def iou(self) -> float:
        """Intersection over union, 0..1; NaN when nothing is true and nothing was said."""
        union = self.true_positive + self.false_positive + self.false_negative
        return ratio(self.true_positive, union)


def compare(predicted: BoolArray, truth: BoolArray) -> SegmentationCounts:
    """Count the points of a prediction (N,) bool against the truth (N,) bool.

    Raises:
        InputError: The two are not (N,) bool of one length.
    """
    if predicted.dtype != np.bool_ or truth.dtype != np.bool_:
        raise InputError(f"labels must be bool, not {predicted.dtype} and {truth.dtype}")
    if predicted.ndim != 1 or predicted.shape != truth.shape:
        raise InputError(f"labels differ in shape: {predicted.shape} and {truth.shape}")
    both = int(np.count_nonzero(predicted & truth))
    said = int(np.count_nonzero(predicted))
    true = int(np.count_nonzero(truth))
    return SegmentationCounts(
        true_positive=both,
        false_positive=said - both,
        false_negative=true - both,
        true_negative=len(truth) - said - true + both,
    )
