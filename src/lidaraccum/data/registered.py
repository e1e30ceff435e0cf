"""Frames whose place is known: what registration hands to the rest of the pipeline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame

LONGEST_SWEEP_S = 0.25
"""A time per point that reaches farther from the stamp is no time within one sweep."""


@dataclass(frozen=True)
class RegistrationQuality:
    """How far a pose can be trusted.

    Attributes:
        hypothesis: Which start won: ``previous`` (constant velocity), ``still``, ``shift``,
            ``given``, ``first``.
        overlap: 0..1: share of the frame's points that found a partner in the map.
        residual_m: Median point-to-plane distance to the map, metres.
        doubts: Why the pose is doubtful, in words; empty when it is not.
    """

    hypothesis: str
    overlap: float
    residual_m: float
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class RegisteredFrame:
    """A frame and where the sensor was.

    Attributes:
        index: Place of the frame in the sequence, from 0.
        frame: The frame, its points deskewed to the stamp where that was called for.
        world_from_sensor: (4, 4) float64 pose at the frame's stamp; the world is the first frame's
            sensor coordinates unless poses were given.
        quality: How far the pose can be trusted.
        deskewed: Whether the points were moved to the stamp.
        seconds_from_stamp: (N,) float32: when each point was measured, by the clock that
            registration went by; None where nothing tells or nobody is to look.
    """

    index: int
    frame: Frame
    world_from_sensor: NDArray[np.float64]
    quality: RegistrationQuality
    deskewed: bool = False
    seconds_from_stamp: NDArray[np.float32] | None = None

    @property
    def seconds_within_sweep(self) -> NDArray[np.float64] | None:
        """(N,) `seconds_from_stamp`; None where nothing tells, or nothing that a sweep can take."""
        seconds = self.seconds_from_stamp
        if seconds is None or not np.abs(seconds).max(initial=0.0) <= LONGEST_SWEEP_S:
            return None
        return seconds.astype(np.float64)
