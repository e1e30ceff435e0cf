"""A Kalman tracker of centroids: what association is measured against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidaraccum.evaluation.clusters import Ids, Points, cluster_points

MIN_VOXELS = 5
"""One frame's share of an object is smaller than a window's."""
CENTROID_SIGMA_M = 0.2
ACCELERATION_SIGMA = 3.0
SPEED_SIGMA_MPS = 10.0
"""What is thought of a new track's velocity, m/s."""
GATE_SIGMAS = 3.0


@dataclass
class Track:
    """An object's place and velocity at constant velocity, axis by axis alike.

    Attributes:
        id: Positive.
        state: (2, 3) place and velocity, metres, seconds, world.
        covariance: (2, 2) of place and velocity along any axis.
        places: Filtered place (3,) by frame.
    """

    id: int
    state: NDArray[np.float64]
    covariance: NDArray[np.float64] = field(
        default_factory=lambda: np.diag([CENTROID_SIGMA_M**2, SPEED_SIGMA_MPS**2])
    )
    places: dict[int, NDArray[np.float64]] = field(default_factory=dict)

    def predict(self, seconds: float) -> None:
        """Move on at constant velocity."""
        step = np.array([[1.0, seconds], [0.0, 1.0]])
        push = np.array([0.5 * seconds**2, seconds]) * ACCELERATION_SIGMA
        self.state = step @ self.state
        self.covariance = step @ self.covariance @ step.T + np.outer(push, push)

    def update(self, frame: int, centroid: NDArray[np.float64]) -> None:
        """Take in a centroid (3,) seen in a frame."""
        gain = self.covariance[:, 0] / (self.covariance[0, 0] + CENTROID_SIGMA_M**2)
        self.state = self.state + gain[:, None] * (centroid - self.state[0])
        self.covariance = self.covariance - np.outer(gain, self.covariance[0])
        self.places[frame] = self.state[0].copy()

    @property
    def gate_m(self) -> float:
        """How far from the prediction a centroid may lie."""
        return GATE_SIGMAS * float(np.sqrt(self.covariance[0, 0] + CENTROID_SIGMA_M**2))


class KalmanTracker:
    """Clusters each frame alone and follows the centroids, greedily, at constant velocity.

    After AB3DMOT (Weng et al., IROS 2020), with centroids in place of boxes, as in the paper's
    ablation "Kalman tracker".
    """

    def __init__(self) -> None:
        self.tracks: list[Track] = []
        self._stamp: float | None = None

    def follow(self, frames: Sequence[Points], stamps: Sequence[float]) -> list[Ids]:
        """Ids of all frames' points (N_t, 3), world, one id an object."""
        return [
            self._step(number, points, stamp)
            for number, (points, stamp) in enumerate(zip(frames, stamps, strict=True))
        ]

    def _step(self, frame: int, points: Points, stamp: float) -> Ids:
        for track in self.tracks:
            track.predict(stamp - (stamp if self._stamp is None else self._stamp))
        self._stamp = stamp
        clusters = cluster_points(points, MIN_VOXELS)
        numbers = np.unique(clusters[clusters > 0])
        centroids = np.array([points[clusters == number].mean(axis=0) for number in numbers])
        owner = np.zeros(len(numbers) + 1, dtype=np.int32)
        for number, track in self._matches(centroids.reshape(-1, 3)):
            track.update(frame, centroids[number])
            owner[number + 1] = track.id
        return owner[clusters]

    def _matches(self, centroids: Points) -> list[tuple[int, Track]]:
        """Nearest pairs first, each within the track's gate; new tracks for what is left."""
        pairs = sorted(
            (float(np.linalg.norm(centroid - track.state[0])), number, track.id)
            for number, centroid in enumerate(centroids)
            for track in self.tracks
        )
        by_id = {track.id: track for track in self.tracks}
        matched: dict[int, Track] = {}
        for distance, number, name in pairs:
            if number not in matched and name in by_id and distance < by_id[name].gate_m:
                matched[number] = by_id.pop(name)
        for number, centroid in enumerate(centroids):
            if number not in matched:
                state = np.stack([centroid, np.zeros(3)])
                matched[number] = Track(len(self.tracks) + 1, state)
                self.tracks.append(matched[number])
        return sorted(matched.items())
