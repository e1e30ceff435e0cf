"""Raw float32 records without a header: KITTI (4 fields), nuScenes (5), or as named."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.io.columns import Columns, columns_of_names, readable

KITTI_FIELDS = ("x", "y", "z", "intensity")
NUSCENES_FIELDS = ("x", "y", "z", "intensity", "ring")
NUSCENES_SUFFIX = ".pcd.bin"
BYTES_PER_VALUE = 4
SAMPLE_VALUES = 500


def read_bin(path: Path, fields: Sequence[str] = ()) -> Columns:
    """Read float32 records.

    Args:
        path: The file.
        fields: Names of the record's fields, ``x``, ``y``, ``z`` among them; empty for KITTI's
            four, or nuScenes' five when the file is called ``*.pcd.bin``.

    Raises:
        InputError: The size is no multiple of a record, or a named field is missing.
    """
    names = tuple(fields) or default_fields(path)
    with readable(path):
        size = path.stat().st_size
        check_size(path, size, names, given=bool(fields))
        flat = np.fromfile(path, dtype="<f4")
    if not fields and names == KITTI_FIELDS and has_ring_column(flat):
        raise InputError(
            f"{path} looks like 5 fields a point, the last one the ring, not KITTI's 4",
            hint="name them with --bin-fields x,y,z,intensity,ring",
        )
    values = flat.reshape(-1, len(names))
    by_name = {name: np.ascontiguousarray(values[:, column]) for column, name in enumerate(names)}
    return columns_of_names(path, by_name)


def default_fields(path: Path) -> tuple[str, ...]:
    """What the file's name promises."""
    return NUSCENES_FIELDS if path.name.lower().endswith(NUSCENES_SUFFIX) else KITTI_FIELDS


def has_ring_column(flat: NDArray[np.float32]) -> bool:
    """Whether every fifth value is a small whole number, not always the same.

    KITTI's four fields, read five by five, put coordinates there.
    """
    if len(flat) % len(NUSCENES_FIELDS) or len(flat) < SAMPLE_VALUES:
        return False
    fifth = flat[:SAMPLE_VALUES].reshape(-1, len(NUSCENES_FIELDS))[:, -1]
    whole = (fifth >= 0) & (fifth < 256) & (fifth == np.floor(fifth))
    return bool(whole.all() and fifth.min() < fifth.max())


def check_size(path: Path, size: int, names: Sequence[str], *, given: bool) -> None:
    """Raise InputError unless ``size`` bytes are whole records of the named fields."""
    record = BYTES_PER_VALUE * len(names)
    if size % record == 0:
        return
    hint = "the file may be truncated"
    fitting = [count for count in (4, 5, 3, 6) if size % (BYTES_PER_VALUE * count) == 0]
    if fitting and not given:
        hint = f"{fitting[0]} fields would fit: name them with --bin-fields, such as " + ",".join(
            ("x", "y", "z", "intensity", "ring", "t")[: fitting[0]]
        )
    raise InputError(
        f"{path} has {size} bytes, not a multiple of {record} ({len(names)} float32 fields: "
        f"{', '.join(names)})",
        hint=hint,
    )
