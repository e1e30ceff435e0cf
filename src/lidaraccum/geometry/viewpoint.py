"""Where the sensor was, for points whose coordinates start elsewhere: on the road under the car."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.ground import LEAST_MOUNT_M, estimate_ground
from lidaraccum.geometry.order import sorted_rows

NEAREST_M, FARTHEST_M = 3.0, 60.0
FARTHEST_ECHO_M = 1_000.0
"""Farther points are damage, not echoes."""

MOST_POINTS = 40_000
STEP_RAD = np.deg2rad(0.5)
UNLIKE = 0.1
"""Relative difference of ranges in one direction that no single surface has."""

BETTER = 0.6
"""Elsewhere is believed where it leaves less than this share of what is hidden from the start."""

HEIGHTS_M = np.arange(1.2, 4.6, 0.2)
HIGHER = 5
STILL_FALLING = 1.5
"""A place is too low if so many heights up the hidden share is this much less: under the sensor it
falls quickly, above it slowly, since from further up all hides less."""

STEPS_M = (0.5, 0.25)
MOST_MOVES = 8


def find_viewpoint(points: NDArray[Any]) -> NDArray[np.float64]:
    """Place (3,) from which points (N, 3) were seen, metres, in their own coordinates, z up.

    The coordinates' own start, unless that lies on the ground, where no sensor is, and elsewhere
    fewer points hide others: a ray ends where it first meets something. Right to some decimetres
    then, enough to ask what was seen through.
    """
    start = np.zeros(3)
    about = points[np.abs(points).max(axis=1, initial=0.0) < FARTHEST_ECHO_M].astype(np.float64)
    if len(about) == 0 or estimate_ground(about).level_from_sensor[2, 3] >= LEAST_MOUNT_M:
        return start
    ranges = np.linalg.norm(about, axis=1)
    seen = about[(ranges > NEAREST_M) & (ranges < FARTHEST_M)]
    seen = seen[:: max(1, -(-len(seen) // MOST_POINTS))]
    place = _raised(seen, start)
    place = _raised(seen, _moved(seen, place))
    return place if _hidden_share(seen, place) < BETTER * _hidden_share(seen, start) else start


def _raised(points: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """The lowest place (3,) above or under one from which further up little more is seen."""
    tried = np.column_stack([np.tile(place[:2], (len(HEIGHTS_M), 1)), HEIGHTS_M])
    hidden = np.array([_hidden_share(points, one) for one in tried])
    falling = hidden[:-HIGHER] > STILL_FALLING * hidden[HIGHER:]
    return np.asarray(tried[int(np.argmin(falling))])


def _moved(points: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """The place (3,) about one, as high, from which least is hidden."""
    least = _hidden_share(points, place)
    for step in STEPS_M:
        ways = step * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
        for _ in range(MOST_MOVES):
            hidden = [_hidden_share(points, place + way) for way in ways]
            if min(hidden) >= least:
                break
            place, least = place + ways[int(np.argmin(hidden))], min(hidden)
    return place


def _hidden_share(points: NDArray[np.float64], place: NDArray[np.float64]) -> float:
    """Share of points (N, 3) that lie with a nearer or farther one in one direction from there."""
    if len(points) == 0:
        return 0.0
    ray = points - place
    ranges = np.maximum(np.sqrt(np.einsum("ij,ij->i", ray, ray)), 1e-6)
    column = ((np.arctan2(ray[:, 1], ray[:, 0]) + np.pi) / STEP_RAD).astype(np.int64)
    row = ((np.arcsin(ray[:, 2] / ranges) + np.pi / 2) / STEP_RAD).astype(np.int64)
    pixel = column * 1024 + row
    order, pixel = sorted_rows(pixel)
    unlike = np.abs(np.diff(np.log(ranges.take(order)))) > UNLIKE
    same = pixel[1:] == pixel[:-1]
    return float(np.count_nonzero(same & unlike) / len(points))
