"""NPZ out: each column streams into a file of its own; at the end they are zipped together."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from lidaraccum.io.atomic import remove
from lidaraccum.io.cloud_schema import Chunk

COPY_BYTES = 1 << 20


class NpzEncoder:
    """``points`` (N, 3) float64, the own fields, and every attribute by its name."""

    def __init__(self, path: Path, first: Chunk) -> None:
        self._path = path
        self._folder = path.with_name(f"{path.name}-columns")
        remove(self._folder)
        self._folder.mkdir()
        self._types = {name: values.dtype for name, values in columns_of(first).items()}
        self._files: dict[str, BinaryIO] = {
            name: (self._folder / str(place)).open("w+b") for place, name in enumerate(self._types)
        }
        self._count = 0

    def write(self, chunk: Chunk) -> None:
        """Append one frame's points."""
        for name, values in columns_of(chunk).items():
            self._files[name].write(np.ascontiguousarray(values).tobytes())
        self._count += len(chunk)

    def finish(self) -> None:
        """Zip the columns as .npy files."""
        with zipfile.ZipFile(self._path, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            for name, file in self._files.items():
                with archive.open(f"{name.replace('/', '_')}.npy", "w", force_zip64=True) as member:
                    npy_format.write_array_header_1_0(member, self._header(name))
                    file.seek(0)
                    shutil.copyfileobj(file, member, COPY_BYTES)
        self.abandon()

    def abandon(self) -> None:
        """Close and remove the columns' files."""
        for file in self._files.values():
            file.close()
        remove(self._folder)

    def _header(self, name: str) -> dict[str, Any]:
        shape = (self._count, 3) if name == "points" else (self._count,)
        descr = npy_format.dtype_to_descr(self._types[name])
        return {"descr": descr, "fortran_order": False, "shape": shape}


def columns_of(chunk: Chunk) -> dict[str, NDArray[Any]]:
    """Every column of a chunk by its name."""
    return {"points": chunk.points, **chunk.own, **chunk.attributes}
