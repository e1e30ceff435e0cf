"""What was found when a sequence was opened, and what was met while it was read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class SequenceInfo:
    """What was found, for people and reports.

    Attributes:
        source: As the user named it.
        layout: What it was recognised as, in words.
        format: Of the frames.
        frames: How many, after ``--frames``.
        files: The frames' files, in order; one file when it holds many frames.
        rate_hz: Frames a second.
        rate_from: Where the rate comes from, in words.
        times_from: Where the stamps come from, in words.
        poses_file: Poses found beside the frames, or None.
        poses_used: Where the poses in use come from, in words.
        labels: What truth was found, in words; empty for none.
        crs_wkt: Coordinate reference system, or None.
        warnings: What looks odd, in words.
    """

    source: str
    layout: str
    format: str
    frames: int
    files: tuple[Path, ...]
    rate_hz: float
    rate_from: str
    times_from: str
    poses_file: Path | None
    poses_used: str
    labels: str
    crs_wkt: str | None
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class ReadCounts:
    """Points of the frames read so far, each frame counted once.

    Attributes:
        points: In the files.
        dropped: Not finite, left out.
        no_return: At the sensor's own place, kept.
    """

    points: int = 0
    dropped: int = 0
    no_return: int = 0
