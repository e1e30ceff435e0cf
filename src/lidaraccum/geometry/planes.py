"""Planes through groups of points, from sums that can be kept up to date."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MOMENTS = 10
"""Columns of moments: count, x, y, z, xx, xy, xz, yy, yz, zz (sums over the points)."""


def summed_moments(points: NDArray[np.float64], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Moments (V, 10) of groups of points (N, 3), about the origin.

    Args:
        points: (N, 3), group after group.
        starts: (V,) row at which each group begins.
    """
    x, y, z = np.ascontiguousarray(points.T)
    moments = np.empty((len(starts), MOMENTS))
    moments[:, 0] = np.diff(np.append(starts, len(points)))
    columns = (x, y, z, x * x, x * y, x * z, y * y, y * z, z * z)
    for column, values in enumerate(columns, start=1):
        moments[:, column] = np.add.reduceat(values, starts)
    return moments


def shift_moments(moments: NDArray[np.float64], shift: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moments (V, 10) of the same points, each group moved by ``shift`` (V, 3)."""
    count, sums = moments[:, :1], moments[:, 1:4]
    moved = moments.copy()
    moved[:, 1:4] += count * shift
    for column, (i, j) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)), start=4):
        moved[:, column] += (
            sums[:, i] * shift[:, j]
            + sums[:, j] * shift[:, i]
            + count[:, 0] * shift[:, i] * shift[:, j]
        )
    return moved


def mean_and_covariance(
    moments: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean (V, 3) and covariance (V, 6: xx xy xz yy yz zz) of groups given as moments (V, 10)."""
    mean = moments[:, 1:4] / moments[:, :1]
    x, y, z = mean.T
    products = np.stack([x * x, x * y, x * z, y * y, y * z, z * z], axis=1)
    return mean, moments[:, 4:] / moments[:, :1] - products


def plane_normals(
    covariance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normals (V, 3) of the best planes and all variances (V, 3), smallest first.

    Eigenvalues of the symmetric 3 x 3 matrices (V, 6) in closed form (Smith 1961); a group whose
    normal is undetermined gets an arbitrary one, which equal variances tell.
    """
    xx, xy, xz, yy, yz, zz = covariance.T
    centre = (xx + yy + zz) / 3
    a, b, c = xx - centre, yy - centre, zz - centre
    off = xy * xy + xz * xz + yz * yz
    spread = np.sqrt((a * a + b * b + c * c + 2 * off) / 6) + 1e-30
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    angle = np.arccos(np.clip(determinant / (2 * spread**3), -1, 1)) / 3
    largest = centre + 2 * spread * np.cos(angle)
    smallest = centre + 2 * spread * np.cos(angle + 2 * np.pi / 3)
    normal = _null_direction((xx - smallest, xy, xz, yy - smallest, yz, zz - smallest))
    return normal, np.stack([smallest, 3 * centre - smallest - largest, largest], axis=1)


def _null_direction(
    entries: tuple[NDArray[np.float64], ...],
) -> NDArray[np.float64]:
    """Unit vectors (V, 3) that singular symmetric matrices take to zero.

    The longest of the cross products of two rows.
    """
    xx, xy, xz, yy, yz, zz = entries
    crossed = np.empty((3, 3, len(xx)))
    crossed[0] = xy * yz - xz * yy, xz * xy - xx * yz, xx * yy - xy * xy
    crossed[1] = xy * zz - xz * yz, xz * xz - xx * zz, xx * yz - xy * xz
    crossed[2] = yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz
    length = (crossed**2).sum(axis=1)
    best = length.argmax(axis=0)
    every = np.arange(len(xx))
    return crossed[best, :, every] / (np.sqrt(length[best, every]) + 1e-30)[:, None]
