"""Planes through groups of points, from sums that can be kept up to date."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

MOMENTS = 10
"""Rows of moments: count, x, y, z, xx, xy, xz, yy, yz, zz (sums over the points)."""

_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def summed_moments(places: NDArray[Any], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Moments (10, V) of groups of points, about the origin.

    Args:
        places: (3, N) x, y and z, group after group.
        starts: (V,) point at which each group begins.
    """
    moments = np.empty((MOMENTS, len(starts)))
    moments[0] = np.diff(starts, append=places.shape[1])
    columns = (*places, *(places[i] * places[j] for i, j in _PAIRS))
    for sums, values in zip(moments[1:], columns, strict=True):
        np.add.reduceat(values, starts, dtype=np.float64, out=sums)
    return moments


def shift_moments(moments: NDArray[np.float64], shift: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moments (10, V) of the same points, each group moved by ``shift`` (3, V)."""
    count, sums = moments[0], moments[1:4]
    moved = moments.copy()
    moved[1:4] += count * shift
    for square, (i, j) in zip(moved[4:], _PAIRS, strict=True):
        square += sums[i] * shift[j] + sums[j] * shift[i] + count * shift[i] * shift[j]
    return moved


def mean_and_covariance(
    moments: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean (3, V) and covariance (6, V: xx xy xz yy yz zz) of groups given as moments (10, V)."""
    mean = moments[1:4] / moments[0]
    covariance = moments[4:] / moments[0]
    for entry, (i, j) in zip(covariance, _PAIRS, strict=True):
        entry -= mean[i] * mean[j]
    return mean, covariance


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
    angle = np.arccos(np.clip(determinant / (2 * spread * spread * spread), -1, 1)) / 3
    largest = centre + 2 * spread * np.cos(angle)
    smallest = centre + 2 * spread * np.cos(angle + 2 * np.pi / 3)
    normal = _null_direction((xx - smallest, xy, xz, yy - smallest, yz, zz - smallest))
    return normal, np.stack([smallest, 3 * centre - smallest - largest, largest], axis=1)


def _null_direction(
    entries: tuple[NDArray[np.float64], ...],
) -> NDArray[np.float64]:
    """Unit vectors (V, 3) that singular symmetric matrices take to zero.

    The longest of the cross products of two rows, up to its sign.
    """
    xx, xy, xz, yy, yz, zz = entries
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    crossed = np.array([[a, b, c], [b, d, e], [c, e, f]])
    length = np.einsum("kiv,kiv->kv", crossed, crossed)
    best = length.argmax(axis=0)
    longest = np.take_along_axis(crossed, best[None, None], axis=0)[0]
    return (longest / (np.sqrt(length.max(axis=0)) + 1e-30)).T
