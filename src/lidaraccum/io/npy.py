"""NumPy files in: npy as (N, 3+) or structured, npz with ``points`` and named arrays."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tokenize import TokenError
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.io.columns import (
    Columns,
    columns_of_names,
    columns_of_record,
    flat,
    left_out,
    native,
    readable,
)

DAMAGE = (
    ValueError,
    KeyError,
    EOFError,
    BadZipFile,
    zlib.error,
    TokenError,
    SyntaxError,
    OverflowError,
    MemoryError,
    NotImplementedError,
)
"""What numpy and zipfile raise on a damaged file."""
POINT_KEYS = ("points", "xyz", "positions")
COLUMN_NAMES = ("x", "y", "z", "intensity", "ring")


def read_npy(path: Path) -> Columns:
    """Read an array (N, 3+) whose columns are x, y, z, intensity, ring, or a structured one.

    Columns past the fifth are called ``field_5`` and so on.

    Raises:
        InputError: Foreign, truncated, or of another shape.
    """
    with loaded(path) as array:
        if not isinstance(array, np.ndarray):
            raise InputError(f"{path} is an archive of arrays: call it .npz")
    if array.dtype.names:
        return columns_of_record(path, array.reshape(-1))
    return columns_of_array(path, array)


def read_npz(path: Path) -> Columns:
    """Read ``points`` (N, 3+) and every other array (N,) by its name; or ``x``, ``y``, ``z``.

    Raises:
        InputError: Foreign, truncated, or without points.
    """
    arrays = arrays_of_npz(path)
    key = next((name for name in POINT_KEYS if name in arrays), None)
    if key is None:
        return columns_of_names(path, arrays)
    points = columns_of_array(path, arrays.pop(key))
    count = len(points.xyz)
    attributes = {**points.attributes, **flat(arrays, count)}
    return Columns(points.xyz, attributes, warnings=left_out(path, arrays, count))


def arrays_of_npz(path: Path) -> dict[str, NDArray[Any]]:
    """Every array of an archive by its name.

    Raises:
        InputError: Foreign or truncated.
    """
    with loaded(path) as archive:
        if isinstance(archive, np.ndarray):
            raise InputError(f"{path} is one array, not an archive: call it .npy")
        return {name: archive[name] for name in archive.files}


@contextmanager
def loaded(path: Path) -> Iterator[Any]:
    """What numpy finds in the file; pickled objects are refused."""
    with readable(path), path.open("rb") as file:
        try:
            yield np.load(file, allow_pickle=False)
        except InputError:
            raise
        except DAMAGE as error:
            size = path.stat().st_size
            raise InputError(f"{path} ({size} bytes) is no whole NumPy file: {error}") from error


def columns_of_array(path: Path, array: NDArray[Any]) -> Columns:
    """Columns of a plain array (N, 3+)."""
    if array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "fiu":
        raise InputError(f"{path} holds {array.shape} {array.dtype}, not (N, 3 or more) numbers")
    names = [*COLUMN_NAMES, *(f"field_{i}" for i in range(len(COLUMN_NAMES), array.shape[1]))]
    return columns_of_names(path, {names[i]: native(array[:, i]) for i in range(array.shape[1])})
