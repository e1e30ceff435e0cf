"""How often frames come, and when each was taken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.io.layouts import Layout
from lidaraccum.io.settings import InputSettings

DEFAULT_RATE_HZ = 10.0
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


def find_timing(
    layout: Layout, settings: InputSettings, clock_step: Callable[[], float | None]
) -> Timing:
    """The user's rate, else recorded times, else the folder's rate, else the points' clock.

    Args:
        layout: What lies beside the frames.
        settings: What the user says.
        clock_step: Asks the points: seconds between the first two frames, or None.
    """
    if settings.rate_hz is not None:
        return Timing(1.0 / settings.rate_hz, "the given rate", None, "the given rate")
    if layout.stamps is not None and len(layout.stamps) > 1:
        period_s = float(np.median(np.diff(layout.stamps)))
        return Timing(period_s, layout.stamps_from, layout.stamps, layout.stamps_from)
    step = clock_step()
    clock = "the points' own clock"
    if layout.rate_hz is not None:
        said = clock if step else "the stated rate"
        return Timing(1.0 / layout.rate_hz, "meta.json", layout.stamps, said)
    if step is not None and SANE_PERIOD_S[0] <= step <= SANE_PERIOD_S[1]:
        return Timing(step, clock, layout.stamps, clock)
    assumed = f"assumed: {DEFAULT_RATE_HZ:g} Hz"
    return Timing(1.0 / DEFAULT_RATE_HZ, assumed, layout.stamps, clock if step else assumed)
