"""SemanticKITTI label files out: one word for every input point of a frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.accumulation import MOVING, AccumulatedFrame
from lidaraccum.io.atomic import atomic

UNKNOWN_CLASS, STILL_CLASS, MOVING_CLASS = 0, 9, 251
INSTANCE_BITS = 0xFFFF


def label_words(frame: AccumulatedFrame) -> NDArray[np.uint32]:
    """One word (row_count,) for every row of the frame's file.

    Low 16 bits: 9 still, 251 moving, 0 for rows that are not among the frame's points; high 16
    bits: the instance, modulo 65536.
    """
    words = np.full(frame.row_count, UNKNOWN_CLASS, np.uint32)
    motion = np.where(frame.label == MOVING, MOVING_CLASS, STILL_CLASS).astype(np.uint32)
    instance = frame.instance.astype(np.uint32) & INSTANCE_BITS
    words[frame.rows] = motion | (instance << 16)
    return words


def write_label_file(path: Path, frame: AccumulatedFrame, *, overwrite: bool = False) -> None:
    """Write a frame's ``.label`` file, whole or not at all."""
    with atomic(path, overwrite=overwrite) as temporary:
        label_words(frame).astype("<u4").tofile(temporary)
