"""One door to the readers: a file's name says which."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lidaraccum.errors import InputError
from lidaraccum.io.columns import Columns
from lidaraccum.io.listing import FORMATS, format_of


def read_columns(path: Path, bin_fields: Sequence[str] = ()) -> Columns:
    """Read one file of any known format; each reader loads its library when first needed.

    Raises:
        InputError: Unknown format, or the reader's complaint.
    """
    form = format_of(path)
    if form in ("bin", "pcd.bin"):
        from lidaraccum.io.bin import read_bin

        return read_bin(path, bin_fields)
    if form == "ply":
        from lidaraccum.io.ply import read_ply

        return read_ply(path)
    if form in ("las", "laz"):
        from lidaraccum.io.las import read_las

        return read_las(path)
    if form == "pcd":
        from lidaraccum.io.pcd import read_pcd

        return read_pcd(path)
    if form in ("npy", "npz"):
        from lidaraccum.io.npy import read_npy, read_npz

        return read_npy(path) if form == "npy" else read_npz(path)
    raise InputError(f"{path} is of no known format", hint=f"known: {', '.join(sorted(FORMATS))}")
