"""What the spacing and the order of points tell about a spinning sensor's sweep.

A spinning sensor fires at equal steps of azimuth, so in points as measured the step between two
neighbours on one beam is the same near and far. Once a sweep has been compensated for the sensor's
motion it is not: near points have been moved through larger angles than far ones, by an amount that
the motion predicts. No pose better than a rough one is needed, and no order of points.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.order import middle

BEAM_DEG = 0.1
"""Points within such a band of elevation are taken to be on one beam."""

MIN_RANGE_M, MAX_RANGE_M = 2.5, 60.0
SMOOTH_SHARE = 0.01
"""Neighbours whose ranges differ by more of it are not on one surface."""

MAX_STEP_RAD = 0.02
STEP_TOLERANCE = 0.3
"""Steps that differ by more from the usual one jumped over a point, or over a beam."""

MAX_STEPS = 30_000
MIN_STEPS = 500
SEAMS = 12

MEASURED_BELOW, COMPENSATED_ABOVE = 0.3, 0.6
"""The found share of the predicted change: 0 for points as measured, 1 for compensated ones."""

MAX_ERROR = 0.1

ORDERED_SHARE = 0.97
"""Share of a file's points that must follow each other around for its order to be the clock."""

SAME_FIRING_RAD = 1e-3
"""Beams of one firing may look this far back."""


@dataclass(frozen=True)
class Seam:
    """Where a sweep starts and ends, and which way it turns.

    Attributes:
        azimuth_rad: Counterclockwise from x.
        direction: +1 counterclockwise seen from above, -1 clockwise.
    """

    azimuth_rad: float
    direction: int


def is_as_measured(points: NDArray[np.floating], twist: NDArray[np.float64]) -> bool | None:
    """Whether points (N, 3) still hold the motion within the sweep; None when they cannot tell.

    Args:
        points: (N, 3) metres, sensor coordinates, as read.
        twist: (6,) motion over one sweep, sensor axes.
    """
    steps = _steps(points)
    if steps is None:
        return None
    change, azimuth, distance = steps
    every_seam = 2 * np.pi * np.arange(SEAMS) / SEAMS
    predicted = _predicted_changes(azimuth, distance, twist, every_seam)
    shares, errors = zip(*(_fit(change, one) for one in predicted), strict=True)
    if max(errors) > MAX_ERROR:
        return None
    largest = max(abs(share) for share in shares)
    if largest < MEASURED_BELOW:
        return True
    return False if largest > COMPENSATED_ABOVE else None


def _steps(
    points: NDArray[np.floating],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
    """Relative deviation from the usual step, azimuth and range of neighbours on one beam (K,)."""
    x, y, z = np.ascontiguousarray(points.T, dtype=np.float64)
    distance, azimuth = np.sqrt(x * x + y * y), np.arctan2(y, x)
    beam = np.floor(np.rad2deg(np.arctan2(z, distance)) / BEAM_DEG)
    order = np.argsort(beam * 8.0 + azimuth)
    distance, azimuth, beam = distance.take(order), azimuth.take(order), beam.take(order)
    step, middle = np.diff(azimuth), 0.5 * (distance[1:] + distance[:-1])
    usable = (
        (beam[1:] == beam[:-1])
        & (np.abs(np.diff(distance)) < SMOOTH_SHARE * middle)
        & (middle > MIN_RANGE_M)
        & (middle < MAX_RANGE_M)
        & (step > 1e-5)
        & (step < MAX_STEP_RAD)
    )
    if usable.sum() < MIN_STEPS:
        return None
    step, middle = step[usable], middle[usable]
    azimuth = azimuth[:-1][usable] + 0.5 * step
    counts, edges = np.histogram(step, bins=400, range=(0.0, MAX_STEP_RAD))
    usual = edges[counts.argmax()] + 0.5 * (edges[1] - edges[0])
    regular = np.flatnonzero(np.abs(step / usual - 1.0) < STEP_TOLERANCE)
    if len(regular) < MIN_STEPS:
        return None
    regular = regular[:: max(1, len(regular) // MAX_STEPS)]
    step = step[regular]
    return step / np.median(step) - 1.0, azimuth[regular], middle[regular]


def _predicted_changes(
    azimuth: NDArray[np.float64],
    distance: NDArray[np.float64],
    twist: NDArray[np.float64],
    seams_rad: NDArray[np.float64],
) -> Iterator[NDArray[np.float64]]:
    """Relative change (K,) of the steps, had a clockwise sweep been compensated, for each seam."""
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    outward = (cosine * twist[3] + sine * twist[4]) / distance
    along = (cosine * twist[4] - sine * twist[3]) / distance
    steady = -(along + twist[2]) / (2 * np.pi)
    for seam_rad in seams_rad:
        turn = (seam_rad - azimuth) / (2 * np.pi)
        yield steady - (turn - np.floor(turn) - 0.5) * outward


def _fit(change: NDArray[np.float64], predicted: NDArray[np.float64]) -> tuple[float, float]:
    """Robust slope of the found over the predicted change, and its standard error."""
    design = np.stack([predicted, np.ones_like(predicted)])
    weights = np.ones(len(change))
    for _ in range(4):
        weighted = design * weights
        normal_matrix = weighted @ design.T + 1e-12 * np.eye(2)
        slope = np.linalg.solve(normal_matrix, weighted @ change)
        left = change - slope @ design
        spread = 1.48 * middle(np.abs(left)) + 1e-6
        weights = 1.0 / (1.0 + (left / (2 * spread)) ** 2) ** 2
    error = spread * float(np.sqrt(np.linalg.inv(normal_matrix)[0, 0]))
    return float(slope[0]), error


def seam_of_file_order(points: NDArray[np.floating]) -> Seam | None:
    """The seam of a file whose points run once around in order; None for any other order."""
    if len(points) < MIN_STEPS:
        return None
    azimuth = np.arctan2(points[:, 1], points[:, 0]).astype(np.float64)
    firings = azimuth[:: max(1, len(azimuth) // 500)]
    step = np.mod(np.diff(firings) + np.pi, 2 * np.pi) - np.pi
    direction = 1 if step.sum() > 0 else -1
    turned = abs(float(step.sum())) / (2 * np.pi)
    if np.mean(step * direction > -SAME_FIRING_RAD) < ORDERED_SHARE or not 0.9 < turned < 1.1:
        return None
    return Seam(float(azimuth[0]), direction)
