"""When a spinning sensor looks where, found by aligning its frames.

A point of a fixed thing is seen at one azimuth in one frame and at another some frames later. In
sweeps as measured these belong to different parts of the sweep's time, and the two disagree by the
motion in between. So the time of each azimuth is an unknown as the pose is one, and point-to-plane
distances determine it. It comes out as a sawtooth: its place is the seam, its sign the direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid, voxel
from lidaraccum.registration.firing import Seam
from lidaraccum.registration.icp import align, jacobian, kernel_weights, main_face
from lidaraccum.registration.settings import RegistrationSettings
from lidaraccum.registration.surface_map import SurfaceMap

SECTORS = 24
"""Parts of the turn, each with its own time and its own rate of time."""

SURFACE_M = 0.15
"""Frames are thinned to this before they are compared."""

MAX_RANGE_M = 80.0
LEAD = 1.2
"""A seam must explain this many times as much as any other but those beside it."""

ON_AXIS = 0.8
"""Sweeps are cut at the encoder's zero, which is one of the sensor's axes more often than not: a
seam there is taken when it explains this share of what one beside it does."""

MAX_DISTANCE_M = 0.5
MIN_SPREAD_M = 0.01


@dataclass(frozen=True, eq=False)
class Glimpse:
    """One frame of a window whose sweep is looked at.

    Attributes:
        points: (M, 3) usable points as measured, metres, sensor coordinates.
        few: (K, 3) float64 thin choice of them.
        world_from_sensor: (4, 4) estimate.
        twist: (6,) motion over one frame interval about this frame, sensor axes.
    """

    points: NDArray[np.float32]
    few: NDArray[np.float64]
    world_from_sensor: rigid.Pose
    twist: NDArray[np.float64]


@dataclass(frozen=True)
class SweepHeight:
    """How much of a frame interval one turn takes, judging by aligned frames.

    Attributes:
        share: About 1 for consecutive sweeps as measured, 0 where there is no motion inside.
        sigma: Its standard error, matches taken as independent.
    """

    share: float
    sigma: float

    @property
    def gain(self) -> float:
        """Squared sigmas by which it differs from 0."""
        return (self.share / self.sigma) ** 2

    def turned(self, direction: int) -> SweepHeight:
        """The same for time that runs this way around."""
        return SweepHeight(self.share * direction, self.sigma)


class AzimuthTime:
    """Normal equations of the time of each azimuth, summed over pairs of frames."""

    def __init__(self, settings: RegistrationSettings) -> None:
        self._settings = settings
        self._matrix = np.zeros((2 * SECTORS, 2 * SECTORS))
        self._vector = np.zeros(2 * SECTORS)

    def add(self, target: Glimpse, sources: Sequence[Glimpse]) -> None:
        """Learn from pairs of frames; their relative poses are solved along and then dropped."""
        surface = SurfaceMap(self._settings.voxel_m, radius_m=2 * MAX_RANGE_M)
        near = _near(target.points)
        surface.insert(near.take(voxel.thin(near, SURFACE_M), axis=0), now=0)
        for source in sources:
            self._learn(surface, target, source)

    def _learn(self, surface: SurfaceMap, target: Glimpse, source: Glimpse) -> None:
        points = _near(source.few)
        start = rigid.invert(target.world_from_sensor) @ source.world_from_sensor
        pose = align(surface, points, start)
        matches = surface.match(rigid.transform(pose, points).T)
        near = np.flatnonzero(np.abs(matches.distances) < MAX_DISTANCE_M)
        if len(near) < 6:
            return
        measured, normals = points[matches.rows[near]], matches.normals[:, near]
        anchors, distances = matches.anchors.T[near], matches.distances[near]
        source_shift = _shift(source.twist, measured) @ pose[:3, :3].T
        target_shift = _shift(target.twist, anchors)
        slopes = np.concatenate(
            [
                jacobian(matches.places[:, near] - pose[:3, 3:], normals).T,
                np.einsum("ij,ji->i", source_shift, normals)[:, None] * _basis(measured)
                - np.einsum("ij,ji->i", target_shift, normals)[:, None] * _basis(anchors),
            ],
            axis=1,
        )
        spread = max(1.48 * float(np.median(np.abs(distances))), MIN_SPREAD_M)
        weights = kernel_weights(matches, main_face(matches)[1])
        self._sum_up(slopes, distances, weights[near] / spread**2)

    def _sum_up(
        self,
        slopes: NDArray[np.float64],
        distances: NDArray[np.float64],
        weights: NDArray[np.float64],
    ) -> None:
        weighted = slopes * weights[:, None]
        matrix, vector = weighted.T @ slopes, weighted.T @ distances
        pose, cross = matrix[:6, :6] + 1e-6 * np.eye(6), matrix[:6, 6:]
        self._matrix += matrix[6:, 6:] - cross.T @ np.linalg.solve(pose, cross)
        self._vector += vector[6:] - cross.T @ np.linalg.solve(pose, vector[:6])

    def best_seam(self) -> tuple[Seam | None, SweepHeight]:
        """The seam that explains the distances best.

        None where another one, not beside it, does nearly as well: nothing was seen to cross the
        part of the turn between the two.
        """
        heights = [self._height(sector) for sector in range(SECTORS)]
        gains = np.array([height.gain for height in heights])
        best = int(gains.argmax())
        for beside in ((best - 1) % SECTORS, (best + 1) % SECTORS):
            if beside % (SECTORS // 4) == 0 and gains[beside] > ON_AXIS * gains[best]:
                best = beside
        apart = np.abs((np.arange(SECTORS) - best + SECTORS // 2) % SECTORS - SECTORS // 2)
        is_alone = gains[apart > 2].max() * LEAD < gains[best]
        direction = 1 if heights[best].share > 0 else -1
        seam = Seam(2 * np.pi * best / SECTORS, direction)
        return (seam if is_alone else None), heights[best].turned(direction)

    def height_at(self, seam: Seam) -> SweepHeight:
        """What the distances say of a seam that is known from elsewhere."""
        sector = round(seam.azimuth_rad / (2 * np.pi) * SECTORS) % SECTORS
        return self._height(sector).turned(seam.direction)

    def _height(self, sector: int) -> SweepHeight:
        times = _sawtooth(sector)
        curvature = float(times @ self._matrix @ times) + 1e-12
        return SweepHeight(-float(times @ self._vector) / curvature, curvature**-0.5)


def _near(points: NDArray[Any]) -> NDArray[Any]:
    return points.compress((points * points) @ np.ones(3, points.dtype) < MAX_RANGE_M**2, axis=0)


def _shift(twist: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How points (M, 3) move per unit of the twist (6,)."""
    return np.cross(twist[:3], points) + twist[3:]


def _basis(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """For points (M, 3): per sector of azimuth a constant and a slope (M, 48)."""
    part = np.mod(np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi), 1.0) * SECTORS
    sector = np.minimum(part.astype(np.int64), SECTORS - 1)
    basis = np.zeros((len(points), 2 * SECTORS))
    rows = np.arange(len(points))
    basis[rows, 2 * sector] = 1.0
    basis[rows, 2 * sector + 1] = part - sector - 0.5
    return basis


def _sawtooth(seam_sector: int) -> NDArray[np.float64]:
    """Time (48,) of a counterclockwise sweep that starts at a sector's edge, in that basis."""
    later = (np.arange(SECTORS) - seam_sector) % SECTORS
    times = np.zeros(2 * SECTORS)
    times[0::2] = (later + 0.5) / SECTORS - 0.5
    times[1::2] = 1.0 / SECTORS
    return times
