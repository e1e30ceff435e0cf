"""Where the columns of each frame come from: one file a frame, or one file for all."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from lidaraccum.errors import SettingsError
from lidaraccum.io.bin import check_size, default_fields
from lidaraccum.io.columns import Columns, readable
from lidaraccum.io.formats import read_columns
from lidaraccum.io.layouts import Layout
from lidaraccum.io.settings import DEFAULT_RATE_HZ, InputSettings


class FrameSource(Protocol):
    """Where the columns of each frame come from."""

    def __len__(self) -> int: ...

    def label(self, index: int) -> str:
        """What frame ``index`` is called in messages."""

    def columns(self, index: int) -> Columns:
        """Frame ``index``, read anew."""


class FilePerFrame:
    """One file a frame."""

    def __init__(self, files: tuple[Path, ...], bin_fields: tuple[str, ...]) -> None:
        self._files = files
        self._bin_fields = bin_fields

    def __len__(self) -> int:
        return len(self._files)

    def label(self, index: int) -> str:
        """The file's name."""
        return self._files[index].name

    def columns(self, index: int) -> Columns:
        """The file's content."""
        return read_columns(self._files[index], self._bin_fields)


def frame_source(layout: Layout, settings: InputSettings) -> FrameSource:
    """One file a frame, or one LAS file split."""
    if settings.split_by is None:
        return FilePerFrame(layout.frames, settings.bin_fields)
    if len(layout.frames) != 1 or layout.format not in ("las", "laz"):
        raise SettingsError(
            f"--split-by needs one LAS or LAZ file, not {len(layout.frames)} {layout.format} files"
        )
    from lidaraccum.io.split import SplitLas

    rate_hz = settings.rate_hz or layout.rate_hz or DEFAULT_RATE_HZ
    return SplitLas(layout.frames[0], settings.split_by, 1.0 / rate_hz)


def check_bin_files(layout: Layout, settings: InputSettings) -> None:
    """Raise InputError for headerless files whose size no record fits, before any is read."""
    if layout.format in ("bin", "pcd.bin"):
        for path in layout.frames:
            names = settings.bin_fields or default_fields(path)
            with readable(path):
                size = path.stat().st_size
            check_size(path, size, names, given=bool(settings.bin_fields))
