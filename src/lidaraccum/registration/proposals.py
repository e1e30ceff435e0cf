"""Where a frame might be, with no guess at all: correlation of two pictures of upright things."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.spatial.transform import Rotation

from lidaraccum.geometry import rigid, voxel

CELL_M = 0.5
CELLS = 256
"""The picture: 128 m square."""

MIN_STOREYS = 2
"""A column of the picture needs this many occupied cells above each other: ground has one, and
its rings, which travel with the sensor, would vote for standing still."""

TURN_STEP_DEG = 2.0
PEAKS = 3
"""Shifts kept for each turn."""


@dataclass(frozen=True)
class Reach:
    """How far a frame can be from the one before: metres and radians."""

    shift_m: float
    turn_rad: float


def shift_proposals(
    target: NDArray[np.float64],
    source: NDArray[np.float64],
    reach: Reach,
    axis: int = 2,
    count: int = 6,
) -> list[rigid.Pose]:
    """Motions target_from_source, most likely first, that slide and turn about one axis.

    The pictures count the occupied cells above each other along ``axis``; they are compared at
    all shifts at once (phase of the Fourier transform kept, so plain correlation).

    Args:
        target: (N, 3) metres, about the place the source is expected at.
        source: (M, 3) metres, sensor coordinates.
        reach: Shifts and turns looked at.
        axis: 0, 1 or 2: the axis of the turn; 2 for a sensor that stands upright.
        count: Proposals wanted at most.
    """
    target_spectrum = fft.rfft2(_picture(target, axis))
    found: list[tuple[float, float, NDArray[np.float64]]] = []
    for turn in _turns(reach.turn_rad):
        turned = source @ _turn(axis, turn)[:3, :3].T
        spectrum = fft.rfft2(_picture(turned, axis))
        agreement = fft.irfft2(target_spectrum * spectrum.conj(), s=(CELLS, CELLS))
        found.extend((value, turn, shift) for value, shift in _peaks(agreement, reach.shift_m))
    found.sort(key=lambda candidate: -candidate[0])
    motions = []
    for _, turn, shift in found[:count]:
        motion = _turn(axis, turn)
        motion[[i for i in range(3) if i != axis], 3] = shift
        motions.append(motion)
    return motions


def _turns(reach_rad: float) -> NDArray[np.float64]:
    steps = int(np.ceil(np.rad2deg(reach_rad) / TURN_STEP_DEG))
    return np.deg2rad(TURN_STEP_DEG) * np.arange(-steps, steps + 1)


def _turn(axis: int, angle: float) -> rigid.Pose:
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(angle * np.eye(3)[axis]).as_matrix()
    return motion


def _picture(points: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Columns (256, 256) with something upright in them; far ones wrap around."""
    cells = voxel.voxel_cells(np.unique(voxel.voxel_keys(points, CELL_M)))
    row, column = (cells[:, other] for other in range(3) if other != axis)
    flat = (row % CELLS) * CELLS + column % CELLS
    storeys = np.bincount(flat, minlength=CELLS * CELLS).astype(np.float32)
    storeys[storeys < MIN_STOREYS] = 0.0
    return np.sqrt(np.minimum(storeys, 9.0)).reshape(CELLS, CELLS)


def _peaks(
    agreement: NDArray[np.float64], reach_m: float
) -> Iterator[tuple[float, NDArray[np.float64]]]:
    """The best shifts (2,) in metres within reach, one a neighbourhood, with their agreement."""
    cells = min(int(np.ceil(reach_m / CELL_M)), CELLS // 2 - 1)
    around = np.arange(-cells, cells + 1)
    window = agreement[np.ix_(around % CELLS, around % CELLS)].copy()
    window[np.hypot(*np.meshgrid(around, around)) > cells + 0.5] = -np.inf
    for _ in range(PEAKS):
        row, column = np.unravel_index(int(window.argmax()), window.shape)
        value = float(window[row, column])
        if not value > 0:
            return
        yield value, CELL_M * np.array([around[row], around[column]])
        window[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = -np.inf
