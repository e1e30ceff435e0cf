"""What was seen from one place, asked from another: evidence that no pattern of beams can fake.

Rings of points travel with the sensor. A plane that few of them crossed fits best where they were
before, so along a bare wall planes speak for standing still. Here a surface between two beams is
known only to lie between what the two met, and whatever lies there agrees. A bare tube therefore
agrees with any motion along it; only where something begins or ends do motions differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray, Frame
from lidaraccum.geometry import rigid
from lidaraccum.geometry.viewpoint import find_viewpoint

ROW_RAD = np.deg2rad(0.25)
ROWS = 480
"""Rows of the picture, from 60 degrees below the horizon to 60 above it."""

FINEST_COLUMNS, COARSEST_COLUMNS = 720, 180
FULL_RATIO = 1.15
"""Columns are as wide as leaves hardly one empty: halving their number must fill no more."""

MIN_RANGE_M = 1.0
WIDEST_GAP_ROWS = 16
"""Beams farther apart say nothing of what is between them."""

MIN_COLUMNS = 2
"""Columns with beams, of the three about a place, below which nothing is known about it."""

MOST_POINTS = 1200
"""So many points of a frame are looked at from another, up to twice as many."""

MARGIN_M, MARGIN_PER_M = 0.1, 0.01
"""A point so far from what was seen (and so much more per metre of range) contradicts it."""


class Sightlines:
    """Between which ranges a frame's surfaces lie, for any direction.

    Args:
        points: (N, 3) metres, in the frame's coordinates.
        viewpoint: (3,) where the sensor is in them.
    """

    def __init__(self, points: NDArray[np.float64], viewpoint: NDArray[np.float64]) -> None:
        self._viewpoint = viewpoint
        azimuth, elevation, ranges = self._polar(points)
        row = ((elevation / ROW_RAD) + ROWS / 2).astype(np.int64)
        inside = (ranges > MIN_RANGE_M) & (row >= 0) & (row < ROWS)
        row, ranges = row[inside], ranges[inside]
        self._columns = _fitting_columns(azimuth[inside])
        pixel = row * self._columns + self._column(azimuth[inside])
        nearest = np.full(ROWS * self._columns, np.inf)
        farthest = np.full(ROWS * self._columns, -np.inf)
        np.minimum.at(nearest, pixel, ranges)
        np.maximum.at(farthest, pixel, ranges)
        shape = (ROWS, self._columns)
        near, far, known = _between_beams(nearest.reshape(shape), farthest.reshape(shape))
        enough = _with_beside(np.add, known.astype(np.int8)) >= MIN_COLUMNS
        self._near = np.where(enough, _with_beside(np.minimum, near), np.nan).ravel()
        self._far = np.where(enough, _with_beside(np.maximum, far), np.nan).ravel()

    def agreement(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How well places (N, 3), the frame's coordinates, fit what it saw: (N,) 0..1 or NaN."""
        azimuth, elevation, ranges = self._polar(points)
        row = np.clip((elevation / ROW_RAD + ROWS / 2).astype(np.int64), 0, ROWS - 1)
        pixel = row * self._columns + self._column(azimuth)
        outside = np.maximum(self._near[pixel] - ranges, ranges - self._far[pixel])
        share = np.maximum(outside, 0.0) / (MARGIN_M + MARGIN_PER_M * ranges)
        return np.asarray(1.0 - np.minimum(share, 1.0) ** 2)

    def _polar(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        x, y, z = (points - self._viewpoint).T
        ranges = np.sqrt(x * x + y * y + z * z)
        sine = z / np.maximum(ranges, 1e-6)
        return np.arctan2(y, x), np.arcsin(np.clip(sine, -1.0, 1.0)), ranges

    def _column(self, azimuth: NDArray[np.float64]) -> NDArray[np.int64]:
        turns = azimuth / (2 * np.pi) + 0.5
        column = (turns * self._columns).astype(np.int64)
        return np.where(column == self._columns, 0, column)


class Eye:
    """Where the sensor is in its frames' coordinates; found when first asked for."""

    def __init__(self) -> None:
        self._place: NDArray[np.float64] | None = None

    def place(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Place (3,), from any frame's points (N, 3), metres."""
        if self._place is None:
            self._place = find_viewpoint(points)
        return self._place


@dataclass(frozen=True, eq=False)
class Sight:
    """A frame to be looked from and at.

    Attributes:
        frame: Its points at the stamp.
        usable: (N,) bool: those that registration may use.
        rows: (M,) int64: a thin choice of them.
        world_from_sensor: (4, 4).
        eye: Shared by the frames of a sensor.
    """

    frame: Frame
    usable: BoolArray
    rows: NDArray[np.int64]
    world_from_sensor: rigid.Pose
    eye: Eye

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """(N, 3) usable points, metres, sensor coordinates."""
        return self.frame.points[self.usable].astype(np.float64)

    @cached_property
    def few(self) -> NDArray[np.float64]:
        """(K, 3) of the thin choice, about `MOST_POINTS`, metres, sensor coordinates."""
        rows = self.rows[:: max(1, len(self.rows) // MOST_POINTS)]
        return self.frame.points[rows].astype(np.float64)

    @cached_property
    def lines(self) -> Sightlines:
        """What it saw."""
        return Sightlines(self.points, self.eye.place(self.points))

    def agreement(self, other: Sight, own_from_others: NDArray[np.float64]) -> NDArray[np.float64]:
        """How well another frame's points fit this one's sight, and the other way around.

        Args:
            other: The other frame.
            own_from_others: (L, 4, 4) poses that it may have.

        Returns:
            (L, K) for each pose and point.
        """
        there = self._agreement_at(own_from_others, other.few)
        back = other._agreement_at(rigid.invert(own_from_others), self.few)
        return np.concatenate([there, back], axis=1)

    def _agreement_at(
        self, own_from_others: NDArray[np.float64], few: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """How well points (K, 3), seen from each of many poses (L, 4, 4), fit the sight: (L, K)."""
        columns = np.ascontiguousarray(few.T)
        places = np.einsum("lij,jk->ilk", own_from_others[:, :3, :3], columns)
        places += own_from_others[:, :3, 3].T[:, :, None]
        return self.lines.agreement(places.reshape(3, -1).T).reshape(len(own_from_others), -1)


def gain(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """By how many standard deviations one agreement (M,) exceeds another of the same points."""
    more = (one - other)[np.isfinite(one) & np.isfinite(other)]
    return float(more.sum() / np.sqrt((more**2).sum() + 1.0))


def _fitting_columns(azimuth: NDArray[np.float64]) -> int:
    turns = azimuth / (2 * np.pi) + 0.5
    columns = FINEST_COLUMNS
    filled = _filled(turns, columns)
    while columns > COARSEST_COLUMNS:
        fewer = _filled(turns, columns // 2)
        if 2 * fewer < FULL_RATIO * filled:
            break
        columns, filled = columns // 2, fewer
    return columns


def _filled(turns: NDArray[np.float64], columns: int) -> int:
    """How many of so many columns the azimuths (N,), in turns, fall into."""
    return int(np.count_nonzero(np.bincount((turns * columns).astype(np.int64))))


def _between_beams(
    nearest: NDArray[np.float64], farthest: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], BoolArray]:
    """Range bounds (R, C) of each pixel with the next beams below and above; where both are."""
    met = np.isfinite(nearest)
    row = np.arange(ROWS, dtype=np.int32)[:, None]
    below = np.maximum.accumulate(np.where(met, row, -1))
    above = np.minimum.accumulate(np.where(met, row, ROWS)[::-1])[::-1]
    nothing = np.full((1, met.shape[1]), -1, dtype=np.int32)
    below = np.concatenate([nothing, below[:-1]])
    above = np.concatenate([above[1:], nothing + (ROWS + 1)])
    known = (below >= 0) & (above < ROWS) & (above - below <= WIDEST_GAP_ROWS)
    at = np.flatnonzero(known)
    columns, column = met.shape[1], at % met.shape[1]
    low, high = below.ravel()[at] * columns + column, above.ravel()[at] * columns + column
    near, far = np.full(met.shape, np.inf), np.full(met.shape, -np.inf)
    for bound, image, wider in ((near, nearest, np.minimum), (far, farthest, np.maximum)):
        flat = image.ravel()
        bound.ravel()[at] = wider(flat[at], wider(flat[low], flat[high]))
    return near, far, known


def _with_beside(combine: np.ufunc, image: NDArray[Any]) -> NDArray[Any]:
    """The image (R, C), closed round the sensor, each pixel with those left and right of it."""
    both = combine(np.roll(image, -1, axis=1), np.roll(image, 1, axis=1))
    return np.asarray(combine(image, both))
