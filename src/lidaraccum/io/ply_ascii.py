"""The usual ascii PLY, quickly: vertices first, scalar properties only.

plyfile reads text row by row in Python, seconds a frame; numpy's text reader takes a tenth of it.
Whatever is unusual is left to plyfile.
"""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.io.columns import readable

TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}
HEADER = re.compile(rb"\Aply\r?\n(.*?)end_header\r?\n", re.DOTALL)
HEADER_LIMIT = 65536


def read_ascii_vertices(path: Path) -> NDArray[np.void] | None:
    """The vertices as a structured array (N,), or None when the file is not the usual one.

    None, too, when a row is missing or malformed: plyfile says what is wrong.
    """
    with readable(path), path.open("rb") as file:
        head = file.read(HEADER_LIMIT)
        match = HEADER.match(head)
        if match is None:
            return None
        found = usual_vertices(match.group(1).decode("ascii", errors="replace").splitlines())
        if found is None:
            return None
        count, dtype = found
        file.seek(match.end())
        lines = file.read().split(b"\n", count)[:count]
    try:
        rows = np.loadtxt(io.BytesIO(b"\n".join(lines)), dtype=dtype, comments=None, ndmin=1)
    except ValueError:
        return None
    return rows if rows.shape == (count,) else None


def usual_vertices(lines: list[str]) -> tuple[int, np.dtype[np.void]] | None:
    """How many vertices, and of which type, when they come first and have scalars only."""
    count, fields, elements = 0, [], 0
    is_ascii = False
    for words in (line.split() for line in lines):
        if words[:2] == ["format", "ascii"]:
            is_ascii = True
        elif words[:1] == ["element"] and len(words) == 3:
            elements += 1
            if elements == 1:
                if words[1] != "vertex" or not words[2].isdigit():
                    return None
                count = int(words[2])
        elif words[:1] == ["property"] and elements == 1:
            if len(words) != 3 or words[1] not in TYPES:
                return None
            fields.append((words[2], TYPES[words[1]]))
    # Further elements are plyfile's, which says that they are left out.
    return (count, np.dtype(fields)) if is_ascii and elements == 1 and count else None
