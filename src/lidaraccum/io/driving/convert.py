"""A driving log written in the labelled layout."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidaraccum.io.driving.labelling import DYNAMIC_MPS
from lidaraccum.io.driving.log import DrivingLog, LabelledLog
from lidaraccum.io.driving.tracks import Track
from lidaraccum.io.labelled import LabelledSettings, write_labelled_sequence


@dataclass(frozen=True)
class Converted:
    """What became of a log.

    Attributes:
        folder: Where it is.
        frames: Sweeps written.
        objects: Tracked objects that can move.
        moving: Those that do at some sweep.
    """

    folder: Path
    frames: int
    objects: int
    moving: int


def convert_log(
    log: DrivingLog, folder: Path, *, format: str = "ply", overwrite: bool = False
) -> Converted:
    """Write a log as a labelled sequence, whole or not at all.

    Raises:
        InputError: The log cannot be read.
        OutputExistsError: The folder exists and may not be overwritten.
        OutputError: The system refuses.
    """
    sequence = LabelledLog(log)
    settings = LabelledSettings(
        format=format,
        sensor=log.sensor,
        licence=log.licence,
        notes={
            "source": f"{log.dataset}, {log.name}",
            "coordinates": log.coordinates,
            "tracks": [track.name for track in log.tracks],
        },
        overwrite=overwrite,
    )
    write_labelled_sequence(folder, sequence, settings)
    moving = sum(moves(track) for track in log.tracks)
    return Converted(folder, len(sequence), len(log.tracks), moving)


def moves(track: Track) -> bool:
    """Whether the object is dynamic at a stamp at which it was drawn."""
    speeds = np.array([track.speed(stamp) or 0.0 for stamp in track.stamps.tolist()])
    return bool((speeds > DYNAMIC_MPS).any())
