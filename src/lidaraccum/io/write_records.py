"""PLY and PCD out: a text header, then packed little-endian records, streamed.

The header's length is fixed when it is first written, so that the number of points is filled in at
the end without moving the records.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.io.atomic import remove
from lidaraccum.io.cloud_schema import Chunk, Schema

LARGE_COORDINATE_M = 8192.0
"""From here on float32 is coarser than 1 mm; coordinates become double."""
RECORDS_AT_A_TIME = 1_000_000
LARGEST_COUNT_DIGITS = 20
EXACT_IN_DOUBLE = 2**53

PLY_TYPES = {"u1": "uchar", "i4": "int", "f4": "float", "f8": "double"}
PLY_OWN_TYPES = {"frame": "<i4", "label": "u1", "instance": "<i4", "confidence": "<f4"}


class RecordEncoder:
    """Packed records behind a header; a format says its names, its types and its header.

    Float coordinates become double when a later chunk needs it: what was written is read back and
    written anew, piece by piece.
    """

    def __init__(self, path: Path, chunk: Chunk, schema: Schema) -> None:
        self._path = path
        self._beside = path.with_name(f"{path.name}-wide")
        self._schema = schema
        self._names = {key: self.field_name(name) for key, name in schema.file_names.items()}
        self._types = self.field_types(schema)
        self._is_double = is_large(chunk.points)
        self._count = 0
        self._file = path.open("w+b")
        self._file.write(self.header(0))

    def field_name(self, name: str) -> str:
        """What the format calls a column."""
        raise NotImplementedError

    def field_types(self, schema: Schema) -> dict[str, str]:
        """The file's type for each own field and attribute, as numpy writes it."""
        raise NotImplementedError

    def header(self, count: int) -> bytes:
        """The header for so many points, always of the same length."""
        raise NotImplementedError

    @property
    def dtype(self) -> np.dtype[Any]:
        """One record."""
        position = "<f8" if self._is_double else "<f4"
        axes = [(axis, position) for axis in "xyz"]
        return np.dtype(axes + [(self._names[key], kind) for key, kind in self._types.items()])

    def write(self, chunk: Chunk) -> None:
        """Append one frame's points."""
        if not self._is_double and is_large(chunk.points):
            self._widen()
        records = np.empty(len(chunk), self.dtype)
        for axis, values in zip("xyz", chunk.points.T, strict=True):
            records[axis] = values
        for key in self._types:
            own = key in chunk.own
            values = chunk.own[key] if own else chunk.attributes[key]
            records[self._names[key]] = values
            if not own:
                self._check_exact(key, values)
        self._file.write(records.tobytes())
        self._count += len(chunk)

    def finish(self) -> None:
        """Fill in the number of points."""
        self._file.seek(0)
        self._file.write(self.header(self._count))
        self._file.close()

    def abandon(self) -> None:
        """Close the file, and leave nothing beside it."""
        self._file.close()
        remove(self._beside)

    def _widen(self) -> None:
        """Write anew, with double coordinates, what was written with float ones."""
        narrow, start = self.dtype, len(self.header(0))
        self._is_double = True
        wide = self.dtype
        self._file.seek(start)
        with self._beside.open("w+b") as target:
            target.write(self.header(0))
            while piece := self._file.read(RECORDS_AT_A_TIME * narrow.itemsize):
                target.write(np.frombuffer(piece, narrow).astype(wide).tobytes())
        self._file.close()
        self._beside.replace(self._path)
        self._file = self._path.open("r+b")
        self._file.seek(0, 2)

    def _check_exact(self, name: str, values: NDArray[Any]) -> None:
        """Say it when whole numbers do not survive the file's floating type."""
        kind = np.dtype(self._types[name])
        if kind.kind != "f" or values.dtype.kind not in "iu" or not len(values):
            return
        largest = max(abs(int(values.max())), abs(int(values.min())))
        if largest > (EXACT_IN_DOUBLE if kind.itemsize == 8 else 2**24):
            self._schema.say_once(f"{name} is rounded: {largest} is too large for {kind}", name)


class PlyEncoder(RecordEncoder):
    """Binary little-endian PLY with CloudCompare's names and Open3D's types."""

    def field_name(self, name: str) -> str:
        """``scalar_NAME``, except ``intensity``."""
        return name if name == "intensity" else f"scalar_{name}"

    def field_types(self, schema: Schema) -> dict[str, str]:
        """Only uchar, int, float and double."""
        types = {**PLY_OWN_TYPES, "time": "<f4"}
        for name, kind in schema.types.items():
            types[name] = "<f4" if name == "intensity" else ply_type(kind)
        return types

    def header(self, count: int) -> bytes:
        """A PLY header; a comment makes up for the length of the count."""
        lines = [
            "ply",
            "format binary_little_endian 1.0",
            "comment lidaraccum",
            f"comment scalar_time: seconds from {self._schema.time_origin:.9f}",
            "comment scalar_label: 0 background, 1 movable but still, 2 moving",
            f"comment {'-' * (LARGEST_COUNT_DIGITS - len(str(count)))}",
            f"element vertex {count}",
        ]
        for name in self.dtype.names or ():
            lines.append(f"property {PLY_TYPES[self.dtype[name].str[1:]]} {name}")
        return ("\n".join([*lines, "end_header"]) + "\n").encode()


class PcdEncoder(RecordEncoder):
    """Binary PCD 0.7, columns in their own types."""

    def field_name(self, name: str) -> str:
        """The plain name."""
        return name

    def field_types(self, schema: Schema) -> dict[str, str]:
        """As they came; PCD has all of numpy's numbers."""
        attributes = {name: kind.newbyteorder("<").str for name, kind in schema.types.items()}
        return {**PLY_OWN_TYPES, "time": "<f8", **attributes}

    def header(self, count: int) -> bytes:
        """A PCD header; a comment makes up for the length of the count."""
        dtype = self.dtype
        fields = [dtype[name] for name in dtype.names or ()]
        lines = [
            "# .PCD v0.7 - Point Cloud Data file format",
            f"# lidaraccum; time: seconds from {self._schema.time_origin:.9f}",
            f"# {'-' * 2 * (LARGEST_COUNT_DIGITS - len(str(count)))}",
            "VERSION 0.7",
            f"FIELDS {' '.join(dtype.names or ())}",
            f"SIZE {' '.join(str(field.itemsize) for field in fields)}",
            f"TYPE {' '.join(field.kind.upper() for field in fields)}",
            f"COUNT {' '.join('1' for _ in fields)}",
            f"WIDTH {count}",
            "HEIGHT 1",
            "VIEWPOINT 0 0 0 1 0 0 0",
            f"POINTS {count}",
            "DATA binary",
        ]
        return ("\n".join(lines) + "\n").encode()


def is_large(points: NDArray[np.float64]) -> bool:
    """Whether float32 would lose a millimetre of these (M, 3) points."""
    return bool(len(points)) and float(np.abs(points).max()) >= LARGE_COORDINATE_M


def ply_type(kind: np.dtype[Any]) -> str:
    """The type among PLY's four that every reader takes: wide whole numbers become double."""
    if kind.kind == "f":
        return "<f4" if kind.itemsize <= 4 else "<f8"
    if kind == np.uint8:
        return "u1"
    fits_int = kind.itemsize < 4 or kind == np.int32
    return "<i4" if fits_int else "<f8"
