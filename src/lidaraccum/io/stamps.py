"""When each frame was taken: from time files, from ``meta.json``, from the frames' names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.io.columns import readable

DIGITS_TO_SECONDS = {10: 1.0, 13: 1e-3, 16: 1e-6, 19: 1e-9}
"""A whole number of that many digits in a name is a time since 1970."""
NUMBER = re.compile(r"(?<!\d)(\d{10,19})(?:[._](\d{3,9}))?(?!\d)")
EARLIEST_EPOCH_S = 6e8
"""Counters are zero-padded to ten digits (KITTI raw), times are not: 6e8 s is 1989."""


def read_times(path: Path) -> NDArray[np.float64]:
    """Seconds (T,) of a text file: one number a line, or ``YYYY-MM-DD HH:MM:SS.fff`` (UTC).

    Raises:
        InputError: A line is neither.
    """
    with readable(path):
        lines = [line.strip() for line in path.read_text().splitlines() if line.strip()]
    try:
        return np.array([seconds_of(line) for line in lines])
    except ValueError as error:
        raise InputError(f"{path} holds a line that is no time: {error}") from error


def seconds_of(text: str) -> float:
    """Seconds of one line; a date is taken as UTC and counted from 1970."""
    if ":" not in text:
        return float(text.split()[0])
    whole, _, fraction = text.replace("T", " ").partition(".")
    moment = datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=timezone.utc)
    return moment.timestamp() + float(f"0.{fraction or 0}")


def stamps_of_names(frames: Sequence[Path]) -> NDArray[np.float64] | None:
    """Seconds (T,) since 1970 that the files' names carry, or None when one carries none."""
    stamps = [stamp_of_name(path.name) for path in frames]
    known = [stamp for stamp in stamps if stamp is not None]
    if len(known) < len(stamps) or len(set(known)) < len(known):
        return None
    return np.array(known)


def stamp_of_name(name: str) -> float | None:
    """The last number of a file's name that can be a time since 1970, in seconds."""
    for whole, fraction in reversed(NUMBER.findall(name)):
        unit = DIGITS_TO_SECONDS.get(len(whole))
        if unit is None or int(whole) * unit < EARLIEST_EPOCH_S:
            continue
        if unit == 1.0 and fraction:
            return float(f"{whole}.{fraction}")
        return int(whole) * unit
    return None
