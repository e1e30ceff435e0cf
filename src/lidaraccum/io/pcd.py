"""PCD in: ascii, binary, binary_compressed.

Own reader, because pypcd4 1.5.1, tried first, trusts the body over the header: an ascii file with
more lines than POINTS gives them all, a truncated binary one gives what is there without a word,
and fields of COUNT > 1 come out of a compressed file in the wrong order.
"""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.io.columns import Columns, columns_of_names, native, readable
from lidaraccum.io.lzf import decompress

HEADER_LIMIT = 65536
PADDING = "_"
COLOUR = ("rgb", "rgba")


@dataclass(frozen=True, eq=False)
class PcdHeader:
    """What the header promises.

    Attributes:
        dtype: One point: each field with its COUNT as a subarray, packed.
        points: How many points; what follows them in the file is no point.
        encoding: ``ascii``, ``binary`` or ``binary_compressed``.
        start: Byte at which the body begins.
    """

    dtype: np.dtype[Any]
    points: int
    encoding: str
    start: int


def read_pcd(path: Path) -> Columns:
    """Read a PCD file; the header's POINTS says how many points it holds.

    Raises:
        InputError: Foreign, damaged or truncated.
    """
    with readable(path):
        content = path.read_bytes()
    header = parse_header(path, content[:HEADER_LIMIT])
    if header.encoding == "ascii":
        table = read_ascii(path, content, header)
    elif header.encoding == "binary":
        table = read_binary(path, content, header)
    else:
        table = read_compressed(path, content, header)
    return columns_of_names(path, scalar_columns(table))


def parse_header(path: Path, head: bytes) -> PcdHeader:
    """The header of a file's first bytes.

    Raises:
        InputError: It is no PCD header.
    """
    words: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in words:
        end = head.find(b"\n", start)
        if end < 0:
            raise InputError(f"{path} is not a PCD file: its header has no line DATA")
        line = head[start:end].decode("ascii", errors="replace").split("#")[0].split()
        start = end + 1
        if line:
            words[line[0].upper()] = line[1:]
    try:
        names = words.get("FIELDS") or words["COLUMNS"]
        counts = [int(word) for word in words.get("COUNT", ["1"] * len(names))]
        kinds = [
            f"<{kind.lower()}{int(size)}"
            for kind, size in zip(words["TYPE"], words["SIZE"], strict=True)
        ]
        points = int(words["POINTS"][0]) if "POINTS" in words else area(words)
        encoding = words["DATA"][0].lower()
        dtype = packed(names, kinds, counts)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise InputError(f"{path} has a PCD header that makes no sense: {error!r}") from error
    if encoding not in ("ascii", "binary", "binary_compressed") or points < 0:
        raise InputError(f"{path} has a PCD header that makes no sense: {points} {encoding}")
    return PcdHeader(dtype, points, encoding, start)


def area(words: dict[str, list[str]]) -> int:
    """WIDTH times HEIGHT."""
    return int(words["WIDTH"][0]) * int(words["HEIGHT"][0])


def packed(names: list[str], kinds: list[str], counts: list[int]) -> np.dtype[Any]:
    """The dtype of one point; padding fields get names of their own."""
    fields = []
    for place, (name, kind, count) in enumerate(zip(names, kinds, counts, strict=True)):
        own = f"{PADDING}{place}" if name == PADDING else name
        fields.append((own, kind, (count,)) if count != 1 else (own, kind))
    return np.dtype(fields)


def read_ascii(path: Path, content: bytes, header: PcdHeader) -> NDArray[Any]:
    """The first POINTS lines as a structured array (N,)."""
    if not header.points:
        return np.zeros(0, header.dtype)
    lines = content[header.start :].split(b"\n", header.points)[: header.points]
    if not b"".join(lines).strip():
        raise InputError(f"{path} is truncated: it promises {header.points} points, but has none")
    body = io.BytesIO(b"\n".join(lines))
    try:
        rows = np.loadtxt(body, dtype=np.float64, ndmin=2)
    except ValueError as error:
        raise InputError(f"{path} is damaged: {error}") from error
    width = sum(int(np.prod(header.dtype[name].shape, dtype=int)) for name in names_of(header))
    if rows.shape != (header.points, width):
        raise InputError(
            f"{path} is truncated: it promises {header.points} points of {width} numbers, "
            f"but has {rows.shape[0]} of {rows.shape[1]} in {len(content)} bytes"
        )
    table = np.zeros(header.points, header.dtype)
    column = 0
    for name in names_of(header):
        count = int(np.prod(header.dtype[name].shape, dtype=int))
        values = rows[:, column : column + count]
        table[name] = values if header.dtype[name].shape else values[:, 0]
        column += count
    return table


def read_binary(path: Path, content: bytes, header: PcdHeader) -> NDArray[Any]:
    """The first POINTS records as a structured array (N,)."""
    needed = header.start + header.points * header.dtype.itemsize
    if len(content) < needed:
        raise InputError(
            f"{path} is truncated: it promises {header.points} points, {needed} bytes in all, "
            f"but has {len(content)}"
        )
    return np.frombuffer(content, header.dtype, header.points, header.start)


def read_compressed(path: Path, content: bytes, header: PcdHeader) -> NDArray[Any]:
    """LZF-compressed planes, one a field, as a structured array (N,)."""
    body = content[header.start :]
    if len(body) < 8:
        raise InputError(f"{path} is truncated: {len(content)} bytes end before the points")
    packed_size, size = struct.unpack_from("<II", body)
    if len(body) < 8 + packed_size:
        needed = header.start + 8 + packed_size
        raise InputError(
            f"{path} is truncated: it promises {needed} bytes in all, but has {len(content)}"
        )
    needed = header.points * header.dtype.itemsize
    try:
        planes = decompress(body[8 : 8 + packed_size], size)
    except ValueError as error:
        raise InputError(f"{path} is damaged: {error}") from error
    if size < needed:
        raise InputError(
            f"{path} is damaged: {header.points} points need {needed} bytes, it unpacks to {size}"
        )
    return table_of_planes(planes, header)


def table_of_planes(planes: bytes, header: PcdHeader) -> NDArray[Any]:
    """A structured array (N,) of bytes that hold one field after the other."""
    # The writer's own number of points sets the length of a plane; POINTS of them count.
    stored = len(planes) // header.dtype.itemsize
    table = np.zeros(header.points, header.dtype)
    offset = 0
    for name in names_of(header):
        kind = header.dtype[name]
        plane = np.frombuffer(planes, kind, stored, offset)
        table[name] = plane[: header.points]
        offset += stored * kind.itemsize
    return table


def names_of(header: PcdHeader) -> tuple[str, ...]:
    """The fields' names, padding included."""
    return header.dtype.names or ()


def scalar_columns(table: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Columns (N,) by name, or (N, COUNT); padding is none.

    PCL packs colours into a float's bits; they are carried as the integer that they are.
    """
    by_name: dict[str, NDArray[Any]] = {}
    for name in table.dtype.names or ():
        values = native(table[name])
        if name.startswith(PADDING) and name[1:].isdigit():
            continue
        if name in COLOUR and values.dtype == np.float32:
            by_name[name] = values.view(np.uint32)
        else:
            by_name[name] = values
    return by_name
