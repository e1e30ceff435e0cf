"""Drift: what a trajectory's error grows to over a distance, and at the end."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.metrics.averages import ratio, ratios
from lidaraccum.metrics.trajectory import (
    PoseErrors,
    Poses,
    check_poses,
    path_lengths,
    relative_errors,
)

KITTI_LENGTHS_M = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
"""Geiger et al., "Are we ready for autonomous driving?" (CVPR 2012), the odometry devkit."""
KITTI_START_STEP = 10
"""Every tenth frame starts a segment; same source."""


@dataclass(frozen=True, eq=False)
class SegmentDrift:
    """Drift over K segments of a path, or over whole paths.

    Attributes:
        length_m: (K,) metres: the segment's nominal length (KITTI), or the path's own.
        errors: K errors of the motion from its start to its end.
    """

    length_m: NDArray[np.float64]
    errors: PoseErrors

    @classmethod
    def pool(cls, parts: Iterable[SegmentDrift]) -> SegmentDrift:
        """All segments of several trajectories; no part at all gives no segments."""
        known = list(parts)
        return cls(
            np.concatenate([np.zeros(0), *(part.length_m for part in known)]),
            PoseErrors.pool(part.errors for part in known),
        )

    def __len__(self) -> int:
        return len(self.length_m)

    @property
    def translation_share(self) -> float:
        """Mean over segments of error over length, metres per metre (x 100: KITTI's per cent).

        NaN when there is no segment, or one has no length (a standing sensor).
        """
        return ratio(float(ratios(self.errors.translation_m, self.length_m).sum()), len(self))

    @property
    def rotation_per_metre(self) -> float:
        """Mean over segments of error over length, radians per metre; NaN likewise."""
        return ratio(float(ratios(self.errors.rotation_rad, self.length_m).sum()), len(self))

    def of_length(self, length_m: float) -> SegmentDrift:
        """Only the segments of one nominal length."""
        keep = self.length_m == length_m
        errors = PoseErrors(self.errors.translation_m[keep], self.errors.rotation_rad[keep])
        return SegmentDrift(self.length_m[keep], errors)


def segment_drift(
    estimated: Poses,
    true: Poses,
    lengths_m: Iterable[float] = KITTI_LENGTHS_M,
    start_step: int = KITTI_START_STEP,
) -> SegmentDrift:
    """KITTI's odometry score: a segment ends at the first frame beyond its length on the true path.

    Drives shorter than 100 m have no segment of KITTI's lengths; give others and say so.

    Args:
        estimated: (T, 4, 4).
        true: (T, 4, 4).
        lengths_m: Nominal lengths, metres.
        start_step: Frames from one segment's start to the next.
    """
    path = path_lengths(true)
    segments = [
        (start, int(end), length)
        for length in lengths_m
        for start in range(0, len(path), start_step)
        if (end := np.searchsorted(path, path[start] + length, side="right")) < len(path)
    ]
    pairs = np.array([(start, end) for start, end, _ in segments], dtype=np.int64)
    return SegmentDrift(
        length_m=np.array([length for _, _, length in segments], dtype=np.float64),
        errors=relative_errors(estimated, true, pairs),
    )


def end_drift(estimated: Poses, true: Poses) -> SegmentDrift:
    """The error of the whole drive's motion, first frame to last, beside the path's length."""
    check_poses(estimated, true)
    return SegmentDrift(
        length_m=path_lengths(true)[-1:],
        errors=relative_errors(estimated, true, np.array([[0, len(true) - 1]])),
    )
