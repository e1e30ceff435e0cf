"""What one frame saw: which places its rays passed through, and which they hit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid

BoolArray = NDArray[np.bool_]
Columns = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]

FINEST_COLUMNS = 1440
COARSEST_COLUMNS = 180
FULL_RATIO = 1.5
"""Columns are as wide as leaves hardly a gap in a row: halving their number must lose so much."""

FINEST_ELEVATION_STEP = np.deg2rad(0.25)
COARSEST_ELEVATION_STEP = np.deg2rad(2.5)
MIN_RANGE_M = 1.0
MARGIN_M = 0.3
MARGIN_PER_M = 0.01
"""A ray must end this far behind a place (and this much more per metre of range) to have passed
through it: more than noise, registration error and uncompensated motion within a sweep."""

SPECK_SHARE = 0.1
"""An echo is a speck where no other about it is as far, give or take this share of its range."""

MIN_RAYS = 6
"""Pixels with rays, of the nine about a place, below which nothing is known about it."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """What a frame's rays say about places.

    Attributes:
        through: (N,) bool: every ray about the place ended well behind it: it was empty.
        met: (N,) bool: the nearest ray about the place ended there. A place that is neither was
            hidden or out of view.
    """

    through: BoolArray
    met: BoolArray


class RangeView:
    """The range image of one frame, for any pattern of beams.

    Args:
        points: (N, 3) metres, in the frame's coordinates; nearer ones to the viewpoint than 1 m are
            the sensor's carrier.
        elevation_step: Radians between rows of the image, at least the gap between beams;
            `elevation_gap` measures it.
        viewpoint: (3,) where the sensor is in these coordinates; at their start when None.
    """

    def __init__(
        self,
        points: NDArray[Any],
        elevation_step: float,
        viewpoint: NDArray[np.float64] | None = None,
    ) -> None:
        self._viewpoint = np.zeros(3) if viewpoint is None else viewpoint
        self._step = float(np.clip(elevation_step, FINEST_ELEVATION_STEP, COARSEST_ELEVATION_STEP))
        self._rows = int(np.pi / self._step) + 2
        self._columns = FINEST_COLUMNS
        pixels, ranges = self._pixels(*self._seen(points, None))
        echo = ranges > MIN_RANGE_M
        flat = np.full(self._rows * self._columns, np.inf, dtype=np.float32)
        np.minimum.at(flat, pixels[echo], ranges[echo])
        image = flat.reshape(self._rows, self._columns)
        seen = np.flatnonzero(np.isfinite(image).any(axis=1))
        # A spinning sensor looks at a band; one row about it, and nothing is known beyond.
        first, last = (max(seen[0] - 1, 0), seen[-1] + 2) if len(seen) else (0, 0)
        band = _without_gaps(image[first:last])
        self._columns = band.shape[1]
        unknown = np.full((self._rows, self._columns), np.nan, dtype=np.float32)
        self._nearest, self._nearest_solid = unknown.ravel(), unknown.copy().ravel()
        self._band = slice(first * self._columns, first * self._columns + band.size)
        if len(band):
            self._nearest[self._band] = _nearest_about(band)
            self._nearest_solid[self._band] = _nearest_about(_without_specks(band))

    def __getstate__(self) -> dict[str, Any]:
        """Without what is beyond the band: mostly nothing, and most of it."""
        state = self.__dict__.copy()
        for name in ("_nearest", "_nearest_solid"):
            state[name] = state[name][self._band]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """As it was."""
        self.__dict__.update(state)
        for name in ("_nearest", "_nearest_solid"):
            whole = np.full(self._rows * self._columns, np.nan, dtype=np.float32)
            whole[self._band] = state[name]
            setattr(self, name, whole)

    def look(self, points: NDArray[Any], own_from_points: rigid.Pose | None = None) -> Sighting:
        """What the frame saw of places (N, 3), metres.

        Args:
            points: In any coordinates; quickest column by column.
            own_from_points: (4, 4) into the frame's coordinates; they are in these when None.
        """
        pixels, ranges = self._pixels(*self._seen(points, own_from_points))
        return _sighting(ranges, self._nearest.take(pixels), self._nearest_solid.take(pixels))

    def _seen(self, points: NDArray[Any], pose: rigid.Pose | None) -> Columns:
        """x, y, z (N,) of points (N, 3) from the viewpoint; a pose (4, 4) takes them here."""
        if pose is None:
            x, y, z = np.ascontiguousarray((points - self._viewpoint).T, dtype=np.float32)
            return x, y, z
        x, y, z = np.ascontiguousarray(points.T, dtype=np.float32)
        rows = np.array(pose[:3], dtype=np.float32)
        rows[:, 3] -= self._viewpoint
        x, y, z = (a * x + b * y + c * z + along for a, b, c, along in rows)
        return x, y, z

    def _pixels(
        self, x: NDArray[np.float32], y: NDArray[np.float32], z: NDArray[np.float32]
    ) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Pixel and range (N,) each of places x, y, z (N,) from the viewpoint."""
        return _pixels(x, y, z, self._columns, self._step)


def look_together(
    views: Sequence[RangeView], places: NDArray[np.float64], counts: NDArray[np.int64]
) -> Sighting:
    """What F frames saw, each of its own places: quicker than one by one where those are few.

    Args:
        views: The frames'.
        places: (3, N) metres, frame by frame, each in its frame's coordinates.
        counts: (F,) places of each frame, together N.
    """
    seen_from = np.array([view._viewpoint for view in views]).T.repeat(counts, axis=1)
    x, y, z = (places - seen_from).astype(np.float32)
    pixels, ranges = _pixels(
        x,
        y,
        z,
        np.array([view._columns for view in views]).repeat(counts),
        np.array([view._step for view in views]).repeat(counts),
    )
    nearest, nearest_solid = np.empty((2, len(ranges)), dtype=np.float32)
    start = 0
    for view, count in zip(views, counts.tolist(), strict=True):
        own = slice(start, start + count)
        view._nearest.take(pixels[own], out=nearest[own], mode="clip")
        view._nearest_solid.take(pixels[own], out=nearest_solid[own], mode="clip")
        start += count
    return _sighting(ranges, nearest, nearest_solid)


def _sighting(
    ranges: NDArray[np.float32], nearest: NDArray[np.float32], nearest_solid: NDArray[np.float32]
) -> Sighting:
    """What it means that rays about places at (N,) metres met their nearest at (N,) metres."""
    margin = MARGIN_M + MARGIN_PER_M * ranges
    behind = nearest_solid - ranges
    met = (np.abs(behind) <= margin) | (np.abs(nearest - ranges) <= margin)
    return Sighting(through=(behind > margin) & ~met, met=met)


def _pixels(
    x: NDArray[np.float32],
    y: NDArray[np.float32],
    z: NDArray[np.float32],
    columns: int | NDArray[np.int64],
    step: float | NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Pixel and range (N,) each of places x, y, z (N,) from the viewpoint.

    Images have so many columns and rows so many radians apart, (N,) or all the same.
    """
    level = x * x + y * y
    azimuth = np.arctan2(y, x) + np.float32(np.pi)
    elevation = np.arctan2(z, np.sqrt(level)) + np.float32(np.pi / 2)
    column = (azimuth * np.float32(columns / (2 * np.pi))).astype(np.int32)
    column[column == columns] = 0
    row = (elevation * np.float32(1 / step)).astype(np.int64)
    row *= columns
    return row + column, np.sqrt(level + z * z)


def _without_gaps(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The image (R, C), inf where no ray went, in columns wide enough for the sensor's rays."""
    while image.shape[1] > COARSEST_COLUMNS:
        wider = np.minimum(image[:, ::2], image[:, 1::2])
        if np.isfinite(image).sum() > FULL_RATIO * np.isfinite(wider).sum():
            break
        image = wider
    return image


def _nearest_about(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Nearest range about each pixel of (R, C), flat; NaN where too few rays went to tell."""
    rays = _over_neighbours(np.add, np.isfinite(image).astype(np.int8))
    return np.where(rays >= MIN_RAYS, _over_neighbours(np.minimum, image), np.nan).ravel()


def _without_specks(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The image (R, C) without echoes that none of the eight about them is as far as.

    Rain, snow, fog and dust return a ray here and there; they hide nothing.
    """
    wide = np.concatenate([image[:, -1:], image, image[:, :1]], axis=1)
    tall = np.concatenate([wide[:1], wide, wide[-1:]])
    tall[[0, -1]] = np.inf
    rows, columns = image.shape
    alone = np.isfinite(image)
    with np.errstate(invalid="ignore"):
        for down in range(3):
            for right in range(3):
                if down != 1 or right != 1:
                    beside = tall[down : down + rows, right : right + columns]
                    alone &= ~(np.abs(beside - image) < SPECK_SHARE * image)
    return np.where(alone, np.float32(np.inf), image)


def _over_neighbours(combine: np.ufunc, image: NDArray[Any]) -> NDArray[Any]:
    """Combine each pixel of (R, C) with the eight about it; columns close round the sensor."""
    wide = np.concatenate([image[:, -1:], image, image[:, :1]], axis=1)
    across = combine(combine(wide[:, :-2], wide[:, 1:-1]), wide[:, 2:])
    tall = np.concatenate([across[:1], across, across[-1:]])
    return combine(combine(tall[:-2], tall[1:-1]), tall[2:])


def elevation_gap(points: NDArray[Any]) -> float:
    """Typical angle between neighbouring beams, radians, from points (N, 3) about the sensor.

    In columns of one degree: the span of elevations over the number of distinct ones.
    """
    fine = np.deg2rad(0.2)
    x, y, z = np.ascontiguousarray(points.T, dtype=np.float32)
    elevation = np.arctan2(z, np.hypot(x, y)) + np.float32(np.pi / 2)
    column = ((np.arctan2(y, x) + np.float32(np.pi)) * np.float32(180 / np.pi)).astype(np.int32)
    row = (elevation / fine).astype(np.int32)
    seen = np.zeros((361, int(np.pi / fine) + 2), dtype=np.bool_)
    seen.ravel()[(column * np.int32(seen.shape[1]) + row).astype(np.int64)] = True
    counts = seen.sum(axis=1)
    full = counts > 4
    if not full.any():
        return float(COARSEST_ELEVATION_STEP)
    last = seen.shape[1] - 1 - seen[:, ::-1].argmax(axis=1)
    span = last - seen.argmax(axis=1)
    return float(fine * np.median(span[full] / (counts[full] - 1)))
