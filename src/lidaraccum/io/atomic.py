"""Files that are there whole or not at all: written beside their final name, then renamed."""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lidaraccum.errors import LidarAccumError, OutputError, OutputExistsError


def check_free(path: Path, overwrite: bool) -> None:
    """Raise OutputExistsError when something is there that may not be overwritten."""
    if path.exists() and not overwrite:
        raise OutputExistsError(f"{path} exists already", hint="--overwrite replaces it")


def temporary_name(path: Path) -> Path:
    """Where a file or folder is made before it gets its name: hidden, in the same folder."""
    return path.with_name(f".{path.name}.tmp-{os.getpid()}")


def prepare(path: Path, overwrite: bool) -> Path:
    """Check that an output may be written, make its folder, and say where to make it."""
    check_free(path, overwrite)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path.parent} cannot be made: {error.strerror or error}") from error
    return temporary_name(path)


def remove(path: Path) -> None:
    """Remove a file or folder; nothing happens when it is not there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def put_in_place(temporary: Path, path: Path) -> None:
    """Give the finished file or folder its name; what was there is replaced."""
    if path.is_dir() and temporary.is_dir():
        # A folder cannot be renamed over a full one: step aside first.
        old = temporary.with_name(f"{temporary.name}.old")
        path.rename(old)
        temporary.rename(path)
        remove(old)
    else:
        temporary.replace(path)


@contextmanager
def atomic(path: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary path to fill; it gets its name on leaving, or is removed on any exception.

    Raises:
        OutputExistsError: ``path`` exists and may not be overwritten.
        OutputError: The system refuses.
    """
    temporary = prepare(path, overwrite)
    try:
        with writable(path):
            yield temporary
            put_in_place(temporary, path)
    except BaseException:
        remove(temporary)
        raise


@contextmanager
def writable(path: Path) -> Iterator[None]:
    """Turns what the system says about an output (disk full, no permission) into `OutputError`."""
    try:
        yield
    except LidarAccumError:
        # Also what went wrong with an input that was read meanwhile: some of them are OSErrors.
        raise
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}") from error


def write_text(path: Path, text: str, *, overwrite: bool = False) -> None:
    """Write a text file, whole or not at all."""
    with atomic(path, overwrite=overwrite) as temporary:
        temporary.write_text(text)


def json_text(data: Any) -> str:
    """Data as JSON; numbers that are not finite, which JSON does not know, as null."""
    return json.dumps(_finite(data), indent=2, allow_nan=False) + "\n"


def write_json(path: Path, data: Any, *, overwrite: bool = False) -> None:
    """Write a JSON file, whole or not at all; numbers that are not finite become null."""
    write_text(path, json_text(data), overwrite=overwrite)


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data
