"""Which clock a recording's sweeps run by: the file's times, the azimuth, or none."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.registration.azimuth_time import AzimuthTime, Glimpse
from lidaraccum.registration.deskew import Compensated, RotatingSweep, SweepClock, TimedSweep
from lidaraccum.registration.firing import Seam, is_as_measured, seam_of_file_order
from lidaraccum.registration.settings import RegistrationSettings

logger = logging.getLogger(__name__)

MIN_GAIN = 60.0
"""Squared sigmas by which a seam must explain the distances before it is believed."""

MIN_SHARE = 0.5
"""The share of the interval that a sweep must seem to take; compensated ones came out below 0.6
with a gain of 15-30, sweeps as measured at 0.65-1.3 with a gain of 60-240."""

MIN_ORDERED_SHARE, MIN_ORDERED_GAIN = 0.3, 6.0
"""The same two where the file's order already names the seam."""

MIN_MOTION_M = 0.15
"""Below this motion per frame a sweep is neither bent much nor able to tell."""

MAX_SWEEP_S = 0.25
"""Frames farther apart are not consecutive sweeps, so a sweep's duration is unknown."""

MAX_WINDOWS = 8
"""Windows looked at before the search is given up."""


class SweepDetector:
    """Looks at windows of frames until it knows the clock."""

    def __init__(self, settings: RegistrationSettings) -> None:
        self._azimuth_time = AzimuthTime(settings)
        self._windows = 0
        self.done = settings.deskew == "off"

    def look(
        self, frames: Sequence[Frame], glimpses: Sequence[Glimpse], interval_s: float
    ) -> SweepClock | None:
        """The clock, once a window shows it; None as long as nothing is known.

        Args:
            frames: Consecutive frames as read, at least two.
            glimpses: The same frames with their estimated motion.
            interval_s: Seconds between frames.
        """
        if self.done or any(frame.origin.any() for frame in frames):
            self.done = True
            return None
        middle = len(frames) // 2
        if np.linalg.norm(glimpses[middle].twist[3:]) < MIN_MOTION_M:
            return None
        self._windows += 1
        self.done = self._windows >= MAX_WINDOWS
        as_measured = is_as_measured(glimpses[middle].points, glimpses[middle].twist)
        if as_measured is None:
            return None
        if not as_measured:
            return self._decide(Compensated())
        if frames[middle].time_offset is not None:
            return self._decide(TimedSweep())
        if interval_s > MAX_SWEEP_S:
            return None
        self._align(glimpses)
        seam = self._seam(frames[middle].points[frames[middle].returned])
        return self._decide(RotatingSweep(seam, interval_s)) if seam is not None else None

    def _decide(self, clock: SweepClock) -> SweepClock:
        self.done = True
        logger.info("motion within a sweep: %s", clock)
        return clock

    def _align(self, glimpses: Sequence[Glimpse]) -> None:
        last = len(glimpses) - 1
        half = last // 2
        self._azimuth_time.add(glimpses[0], [glimpses[at] for at in sorted({half, last} - {0})])
        if half > 0:
            self._azimuth_time.add(glimpses[half], [glimpses[last]])

    def _seam(self, points: NDArray[np.float32]) -> Seam | None:
        """The file's order where aligned frames agree with it; else what they say, if clear.

        Equal steps of azimuth alone do not prove motion inside: a simulated sensor may fire all
        its beams at one time.
        """
        ordered = seam_of_file_order(points)
        if ordered is not None:
            height = self._azimuth_time.height_at(ordered)
            agrees = height.share >= MIN_ORDERED_SHARE and height.gain >= MIN_ORDERED_GAIN
            return ordered if agrees else None
        seam, height = self._azimuth_time.best_seam()
        is_clear = height.share >= MIN_SHARE and height.gain >= MIN_GAIN
        return seam if is_clear else None
