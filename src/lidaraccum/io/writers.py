"""Write an accumulated cloud frame by frame, in bounded memory. Read `open_writer` first."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Protocol

from lidaraccum.data.accumulation import AccumulatedFrame
from lidaraccum.errors import OutputError, SettingsError
from lidaraccum.io.atomic import prepare, put_in_place, remove, writable
from lidaraccum.io.cloud_schema import Chunk, Schema
from lidaraccum.io.columns import LasReference, RawVlr

SUFFIXES = (".ply", ".las", ".laz", ".pcd", ".npz")


@dataclass(frozen=True)
class WriterSettings:
    """How to write a cloud.

    Attributes:
        overwrite: Replace an existing file.
        crs_wkt: Coordinate reference system of the positions, for LAS.
        vlrs: A LAS input's records about it, written back as they came.
        time_origin: Seconds that ``time`` counts from; None for the first frame's stamp.
        standard_gps_time: A LAS input's ``gps_time`` is GPS time less 1e9 s, not of the week.
    """

    overwrite: bool = False
    crs_wkt: str | None = None
    vlrs: tuple[RawVlr, ...] = ()
    time_origin: float | None = None
    standard_gps_time: bool = False


class Encoder(Protocol):
    """One format: takes chunks, and leaves a whole file at the path it was given."""

    def write(self, chunk: Chunk) -> None:
        """Append one frame's points."""

    def finish(self) -> None:
        """Make the file whole."""

    def abandon(self) -> None:
        """Close what is open."""


class CloudWriter:
    """Streams frames into one file, which gets its name when it is whole.

    Use it as a context manager: on an exception, a keyboard interrupt among them, nothing is left.
    """

    def __init__(self, path: Path, settings: WriterSettings) -> None:
        if path.is_dir():
            raise OutputError(f"{path} is a directory, not a file to replace")
        self._path = path
        self._settings = settings
        self._temporary = prepare(path, settings.overwrite)
        self._encoder: Encoder | None = None
        self._schema: Schema | None = None
        self._empty: Chunk | None = None
        self._closed = False
        self.points = 0

    def write(self, frame: AccumulatedFrame) -> None:
        """Append one frame; the first one fixes the output's columns."""
        if self._closed:
            raise OutputError(f"{self._path} is closed already")
        with writable(self._path):
            if self._schema is None:
                self._schema = self._fix_schema(frame)
            chunk = self._schema.chunk(frame)
            # Offsets and scales come from the first points: an empty frame has none to say.
            if self._encoder is None and len(chunk):
                self._encoder = self._start(chunk, self._schema)
            if self._encoder is not None:
                self._encoder.write(chunk)
            elif self._empty is None:
                self._empty = chunk
        self.points += len(chunk)

    def close(self) -> None:
        """Make the file whole and give it its name.

        Raises:
            OutputError: Not one frame was written, or the system refuses.
        """
        if self._closed:
            return
        try:
            with writable(self._path):
                if self._encoder is None and self._schema and self._empty is not None:
                    self._encoder = self._start(self._empty, self._schema)
                if self._encoder is None:
                    raise OutputError(f"{self._path} is not written: there was no frame to write")
                self._encoder.finish()
                put_in_place(self._temporary, self._path)
        except BaseException:
            self.abandon()
            raise
        self._closed = True

    def abandon(self) -> None:
        """Leave nothing."""
        if self._closed:
            return
        self._closed = True
        if self._encoder is not None:
            self._encoder.abandon()
        remove(self._temporary)

    def _fix_schema(self, first: AccumulatedFrame) -> Schema:
        origin = self._settings.time_origin
        types = {name: values.dtype for name, values in first.attributes.items()}
        return Schema(types, first.stamp if origin is None else origin)

    def _start(self, chunk: Chunk, schema: Schema) -> Encoder:
        suffix = self._path.suffix.lower()
        if suffix == ".ply":
            from lidaraccum.io.write_records import PlyEncoder

            return PlyEncoder(self._temporary, chunk, schema)
        if suffix == ".pcd":
            from lidaraccum.io.write_records import PcdEncoder

            return PcdEncoder(self._temporary, chunk, schema)
        if suffix == ".npz":
            from lidaraccum.io.write_npz import NpzEncoder

            return NpzEncoder(self._temporary, chunk)
        from lidaraccum.io.write_las import LasEncoder, LasTarget

        said = self._settings
        reference = LasReference(said.crs_wkt, said.vlrs, said.standard_gps_time)
        target = LasTarget(self._temporary, suffix == ".laz", reference)
        return LasEncoder(target, chunk, schema)

    def __enter__(self) -> CloudWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()


def open_writer(path: Path | str, settings: WriterSettings | None = None) -> CloudWriter:
    """Open a cloud for writing; the suffix says the format.

    Raises:
        SettingsError: Unknown suffix.
        OutputExistsError: The file exists and may not be overwritten.
    """
    check_suffix(Path(path))
    return CloudWriter(Path(path), settings or WriterSettings())


def check_suffix(path: Path) -> None:
    """Raise SettingsError unless the path's suffix is a format that can be written."""
    if path.suffix.lower() not in SUFFIXES:
        raise SettingsError(
            f"{path} has no suffix of a known output format", hint=f"known: {', '.join(SUFFIXES)}"
        )
