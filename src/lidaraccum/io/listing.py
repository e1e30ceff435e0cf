"""Which files make up a sequence, in which order, and of which format."""

from __future__ import annotations

import glob
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from lidaraccum.errors import InputError, MissingInputError, SettingsError
from lidaraccum.io.columns import readable

FORMATS = ("pcd.bin", "bin", "ply", "las", "laz", "pcd", "npy", "npz")
"""Longest suffix first: nuScenes' ``.pcd.bin`` is not KITTI's ``.bin``."""
LIST_SUFFIXES = (".txt", ".lst")
GLOB_MARKS = frozenset("*?[")


def format_of(path: Path) -> str | None:
    """The format that the file's name promises, one of `FORMATS`, or None."""
    name = path.name.lower()
    return next((form for form in FORMATS if name.endswith(f".{form}")), None)


def natural_key(path: Path) -> list[tuple[int, int, str]]:
    """Sorts ``frame_9`` before ``frame_10``."""
    parts = re.split(r"(\d+)", path.name)
    return [(0, int(p), p) if p.isdigit() else (1, 0, p) for p in parts if p]


def frames_in(folder: Path) -> tuple[Path, ...]:
    """Files of the known formats right in a folder, naturally sorted."""
    with readable(folder):
        found = [p for p in folder.iterdir() if format_of(p) and not p.name.startswith(".")]
    # A broken link stays: it is a frame that is missing, not one that never was.
    return tuple(sorted((p for p in found if not p.is_dir()), key=natural_key))


def frames_of_glob(pattern: str) -> tuple[Path, ...]:
    """Files of the known formats that match, naturally sorted by their whole path."""
    found = [Path(name) for name in glob.glob(pattern, recursive=True)]  # noqa: PTH207
    frames = [path for path in found if format_of(path) and path.is_file()]
    if not frames:
        raise MissingInputError(f"no file of a known format matches {pattern}")
    return tuple(sorted(frames, key=lambda path: [natural_key(Path(p)) for p in path.parts]))


def frames_of_list(path: Path) -> tuple[Path, ...]:
    """The paths a list file names, one a line, relative to it; ``#`` begins a comment."""
    with readable(path):
        try:
            lines = path.read_text().splitlines()
        except UnicodeDecodeError as error:
            raise InputError(f"{path} is not a list of paths: it is not text") from error
    named = [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    if not named:
        raise MissingInputError(f"{path} names no frame")
    return checked_paths(path.parent / name for name in named)


def checked_paths(paths: Iterable[Path | str]) -> tuple[Path, ...]:
    """The same paths in the given order, each there and of a known format."""
    listed = tuple(Path(path) for path in paths)
    for path in listed:
        if not path.exists():
            raise MissingInputError(f"{path} does not exist")
        if format_of(path) is None:
            raise InputError(
                f"{path} is of no known format", hint=f"known: {', '.join(sorted(FORMATS))}"
            )
    return listed


def of_one_format(
    frames: Sequence[Path], wanted: str | None, place: str
) -> tuple[tuple[Path, ...], str]:
    """Those frames that are of the wanted format, or all when they are of one, and its name.

    Raises:
        InputError: Formats are mixed and none was chosen.
        MissingInputError: None is of the wanted format.
        SettingsError: The wanted format is unknown.
    """
    if wanted is not None and wanted not in FORMATS:
        raise SettingsError(f"unknown format {wanted}", hint=f"known: {', '.join(sorted(FORMATS))}")
    counts = Counter(format_of(path) or "" for path in frames)
    if wanted is not None:
        kept = tuple(path for path in frames if format_of(path) == wanted)
        if not kept:
            raise MissingInputError(f"{place} holds no {wanted} file")
        return kept, wanted
    if len(counts) > 1:
        said = ", ".join(f"{count} {form}" for form, count in sorted(counts.items()))
        raise InputError(f"{place} mixes formats: {said}", hint="choose one with --format")
    return tuple(frames), next(iter(counts))
