"""What one file holds: columns under the file's own names, nothing interpreted yet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError, MissingInputError

WIDEST = 16
"""An array of more columns than this is no attribute of the points but something else."""


@dataclass(frozen=True)
class RawVlr:
    """A variable length record of a LAS file, kept byte for byte.

    Attributes:
        user_id: Who defined it, ``LASF_Projection`` for coordinate systems.
        record_id: Which record of theirs.
        description: Free text.
        data: The record's body.
    """

    user_id: str
    record_id: int
    description: str
    data: bytes


@dataclass(frozen=True)
class LasReference:
    """What coordinates and times of a LAS file refer to.

    Attributes:
        crs_wkt: Coordinate reference system as WKT, or None.
        vlrs: The records that say so, as they are.
        standard_gps_time: ``gps_time`` is GPS time less 1e9 s; otherwise seconds of the week.
    """

    crs_wkt: str | None = None
    vlrs: tuple[RawVlr, ...] = ()
    standard_gps_time: bool = False


@dataclass(frozen=True, eq=False)
class Columns:
    """The content of one file.

    Attributes:
        xyz: (N, 3) float32 or float64, the file's coordinates.
        attributes: Every other column, (N,) each, in native byte order, by the file's name.
        crs_wkt: Coordinate reference system as WKT, or None.
        vlrs: A LAS file's records about the coordinate system, to be written back.
        standard: Names among ``attributes`` that every file of the format has, used or not.
        warnings: What was left out, in words.
    """

    xyz: NDArray[Any]
    attributes: Mapping[str, NDArray[Any]]
    crs_wkt: str | None = None
    vlrs: tuple[RawVlr, ...] = ()
    standard: frozenset[str] = field(default_factory=frozenset)
    warnings: tuple[str, ...] = ()


def columns_of_record(path: Path, record: NDArray[Any]) -> Columns:
    """Columns of a structured array (N,) with the scalar fields ``x``, ``y``, ``z`` and others.

    Raises:
        InputError: ``x``, ``y`` or ``z`` is missing.
    """
    by_name = {str(name): native(record[name]) for name in record.dtype.names or ()}
    return columns_of_names(path, by_name)


def columns_of_names(path: Path, by_name: Mapping[str, NDArray[Any]]) -> Columns:
    """Columns of arrays (N,) by name; ``x``, ``y``, ``z`` in any case are the position.

    Raises:
        InputError: ``x``, ``y`` or ``z`` is missing.
    """
    axes: dict[str, str] = {}
    for name in by_name:
        axes.setdefault(name.lower(), name)
    missing = [axis for axis in "xyz" if axis not in axes]
    if missing:
        raise InputError(
            f"{path} has no field {' or '.join(missing)}",
            hint=f"it has {', '.join(by_name) or 'no fields'}",
        )
    position = [axes[axis] for axis in "xyz"]
    single = all(by_name[name].dtype == np.float32 for name in position)
    xyz = np.empty((len(by_name[position[0]]), 3), np.float32 if single else np.float64)
    for column, name in enumerate(position):
        xyz[:, column] = by_name[name]
    others = {name: values for name, values in by_name.items() if name not in position}
    return Columns(xyz, flat(others, len(xyz)), warnings=left_out(path, others, len(xyz)))


def flat(by_name: Mapping[str, NDArray[Any]], count: int) -> dict[str, NDArray[Any]]:
    """Numeric columns (count,) by name; one of (count, k) becomes ``name_0`` to ``name_k-1``."""
    columns: dict[str, NDArray[Any]] = {}
    for name, values in by_name.items():
        if not is_carried(values, count):
            continue
        if values.ndim == 1:
            columns[name] = values
        else:
            columns |= {f"{name}_{i}": native(values[:, i]) for i in range(values.shape[1])}
    return columns


def left_out(path: Path, by_name: Mapping[str, NDArray[Any]], count: int) -> tuple[str, ...]:
    """The columns that have no place in a frame, in words."""
    return tuple(
        f"{path.name}: {name} of shape {values.shape} {values.dtype} is left out"
        for name, values in by_name.items()
        if not is_carried(values, count)
    )


def is_carried(values: NDArray[Any], count: int) -> bool:
    """Whether an array is a column of numbers, or a few of them side by side."""
    if values.dtype.kind not in "biuf" or values.shape[:1] != (count,):
        return False
    return values.ndim == 1 or (values.ndim == 2 and values.shape[1] <= WIDEST)


def native(values: NDArray[Any]) -> NDArray[Any]:
    """The same values in memory of their own, contiguous and in this machine's byte order."""
    return np.array(values, dtype=values.dtype.newbyteorder("="), order="C")


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Turns what the system says about a file that cannot be opened into an `InputError`."""
    try:
        yield
    except FileNotFoundError as error:
        raise MissingInputError(f"{path} does not exist") from error
    except PermissionError as error:
        raise InputError(f"{path} may not be read: permission denied") from error
    except IsADirectoryError as error:
        raise InputError(f"{path} is a directory, not a file of points") from error
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
