"""How often frames come, and when each was taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.io.frame_source import FrameSource
from lidaraccum.io.interpret import Occasion, frame_from_columns
from lidaraccum.io.layouts import Layout
from lidaraccum.io.settings import DEFAULT_RATE_HZ, InputSettings

NO_STAMP = -1e12
SANE_PERIOD_S = (0.005, 10.0)


@dataclass(frozen=True, eq=False)
class Timing:
    """When the frames on disk were taken.

    Attributes:
        period_s: Seconds between frames.
        rate_from: Where the rate comes from, in words.
        stamps: (T,) recorded seconds, or None: counted from the rate, or the points' own clock.
        times_from: Where the stamps come from, in words.
    """

    period_s: float
    rate_from: str
    stamps: NDArray[np.float64] | None
    times_from: str


def find_timing(layout: Layout, settings: InputSettings, frames: FrameSource) -> Timing:
    """The user's rate, else recorded times, else the folder's rate, else the points' clock.

    Args:
        layout: What lies beside the frames.
        settings: What the user says.
        frames: To ask the points of the first two.
    """
    if settings.rate_hz is not None:
        return Timing(1.0 / settings.rate_hz, "the given rate", None, "the given rate")
    if layout.stamps is not None and len(layout.stamps) > 1:
        period_s = float(np.median(np.diff(layout.stamps)))
        return Timing(period_s, layout.stamps_from, layout.stamps, layout.stamps_from)
    headerless = layout.format in ("bin", "pcd.bin") and not settings.bin_fields
    step = None if headerless else clock_step(frames, layout.rate_hz or DEFAULT_RATE_HZ)
    clock = "the points' own clock"
    if layout.rate_hz is not None:
        said = clock if step else "the stated rate"
        return Timing(1.0 / layout.rate_hz, "meta.json", layout.stamps, said)
    if step is not None and SANE_PERIOD_S[0] <= step <= SANE_PERIOD_S[1]:
        return Timing(step, clock, layout.stamps, clock)
    assumed = f"assumed: {DEFAULT_RATE_HZ:g} Hz"
    return Timing(1.0 / DEFAULT_RATE_HZ, assumed, layout.stamps, clock if step else assumed)


def clock_step(frames: FrameSource, rate_hz: float) -> float | None:
    """Seconds between the first two frames by a clock among their points, or None."""
    stamps = []
    for place in range(min(2, len(frames))):
        # A stamp that no point can be near to: what replaces it is the points' own.
        occasion = Occasion(frames.label(place), NO_STAMP, 1.0 / rate_hz)
        stamp = frame_from_columns(frames.columns(place), occasion).stamp
        if stamp == NO_STAMP:
            return None
        stamps.append(stamp)
    return stamps[1] - stamps[0] if len(stamps) == 2 else None
