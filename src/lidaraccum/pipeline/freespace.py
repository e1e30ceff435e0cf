"""Free-space evidence: what other frames saw where a frame has its points."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.geometry import rigid
from lidaraccum.geometry.clustering import connected_cells
from lidaraccum.geometry.terrain import estimate_terrain
from lidaraccum.geometry.visibility import MIN_RANGE_M, RangeView, elevation_gap
from lidaraccum.pipeline.motion_settings import MotionSettings

HEIGHT_WEIGHT = 0.5
BEAM_ALLOWANCE_M = 0.1
"""Heights count half in distances, and less where beams lie far apart, so that one beam gap costs
no more than this: the next frame's beams hit the same wall at other heights."""

FARTHEST_ECHO_M = 1_000.0
"""Farther points are damage, not echoes."""

AZIMUTH_BINS = 360

OUTLASTS_BY = 2
"""So many frames may have met something beside a mover where it was not."""

LOW_SHARE = 0.4
"""Points above this share of the least height count as partners and join what stands on them."""


class SightedFrame:
    """A frame's obstacles (all but ground, sky and the carrier) and what other frames saw there.

    Attributes:
        registered: The frame and its pose.
        viewpoint: (3,) metres: where the sensor is in the frame's coordinates.
        gap: Radians between neighbouring beams.
        view: What its rays passed through.
        rows: (M,) int64: the obstacles' rows among the frame's points.
        low_rows: (L,) int64: rows of points lower than obstacles but above the ground.
        ground_rows: (G,) int64: the same and the ground itself.
        ground_heights: (G,) metres, theirs.
        close_rows: (C,) int64: rows of points that stand so close that they may be the carrier.
        near_points: (M + L, 3) float64, metres, sensor coordinates: obstacles, then low points.
        near_heights: (M + L,) metres above the ground.
        close_points: (C, 3) float64, metres, sensor coordinates.
        seconds: (M,) after the stamp, when each obstacle was met; 0 where nothing tells.
        segments: (M,) int64: each obstacle's cluster within this frame.
        segment_sizes: (S,) obstacles in each cluster.
        through: (M,) int16: other frames that saw through the place.
        met: (M,) int16: other frames that saw something at the place.
    """

    def __init__(
        self,
        registered: RegisteredFrame,
        settings: MotionSettings,
        viewpoint: NDArray[np.float64] | None = None,
    ) -> None:
        points = np.asfortranarray(registered.frame.points)  # all looks go column by column
        if np.abs(points).max(initial=0.0) > FARTHEST_ECHO_M:
            # What no sensor can have seen counts as no return: it would stretch every grid.
            beyond = np.abs(points).max(axis=1) > FARTHEST_ECHO_M
            points = np.where(beyond[:, None], np.float32(0), points)
        self.registered = registered
        self.viewpoint = np.zeros(3) if viewpoint is None else viewpoint
        rays = points - self.viewpoint.astype(np.float32)
        self.gap = elevation_gap(rays)
        self.view = RangeView(points, self.gap, self.viewpoint)
        heights = estimate_terrain(points).height_above(points)
        squared = np.einsum("ij,ij->i", rays, rays)
        outside = squared > settings.min_range_m**2
        low_enough = heights < settings.max_height_m
        standing = outside & low_enough
        obstacle = heights >= settings.min_height_m
        self.rows = np.flatnonzero(standing & obstacle)
        self.ground_rows = np.flatnonzero(standing & ~obstacle)
        self.ground_heights = heights.take(self.ground_rows)
        is_low = self.ground_heights > LOW_SHARE * settings.min_height_m
        self.low_rows = self.ground_rows[is_low]
        self.close_rows = np.flatnonzero(
            ~outside & low_enough & obstacle & (squared > MIN_RANGE_M**2)
        )
        self.close_points = _picked(points, self.close_rows)
        near = np.concatenate([self.rows, self.low_rows])
        self.near_points = _picked(points, near)
        self.near_heights = heights.take(near)
        seconds = registered.seconds_within_sweep
        self.seconds = np.zeros(len(self.rows)) if seconds is None else seconds.take(self.rows)
        self.segments = connected_cells(self.points, settings.cell_m)
        self.segment_sizes = np.bincount(self.segments)
        self.through = np.zeros(len(self.rows), dtype=np.int16)
        self.met = np.zeros(len(self.rows), dtype=np.int16)
        self._watched_at: list[float] = []

    @property
    def index(self) -> int:
        """Place of the frame in the sequence."""
        return self.registered.index

    @property
    def stamp(self) -> float:
        """Seconds."""
        return self.registered.frame.stamp

    @property
    def points(self) -> NDArray[np.float64]:
        """(M, 3) obstacles, metres, sensor coordinates."""
        return self.near_points[: len(self.rows)]

    @property
    def heights(self) -> NDArray[np.float64]:
        """(M,) obstacles' heights above the ground, metres."""
        return self.near_heights[: len(self.rows)]

    @property
    def world_from_sensor(self) -> rigid.Pose:
        """(4, 4) pose at the stamp."""
        return self.registered.world_from_sensor

    @cached_property
    def sensor_from_world(self) -> rigid.Pose:
        """(4, 4), the pose's inverse."""
        return rigid.invert(self.world_from_sensor)

    @cached_property
    def tree(self) -> cKDTree:
        """Obstacles and low points by their places."""
        return cKDTree(self.near_places, balanced_tree=False, compact_nodes=False)

    @cached_property
    def near_places(self) -> NDArray[np.float64]:
        """The `places` (M + L, 3) of obstacles and low points."""
        return self.places(self.near_points, self.near_heights)

    @cached_property
    def level(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The obstacles' x and y (M,) each, metres: to ask of all of them at once, quickly."""
        x, y = np.ascontiguousarray(self.points[:, :2].T)
        return x, y

    def places(self, points: NDArray[Any], heights: NDArray[Any]) -> NDArray[np.float64]:
        """Places (N, 3) to measure distances between.

        Args:
            points: (N, 3) metres, sensor coordinates.
            heights: (N,) metres above the ground: hills do not part what is one thing.
        """
        x, y = points[:, 0], points[:, 1]
        return np.column_stack([x, y, height_weight(x, y, self.gap) * heights])

    def world(self, picked: NDArray[np.int64]) -> NDArray[np.float64]:
        """Some of the obstacles (K,) in the world, (K, 3) metres."""
        return self._world.take(picked, axis=0)

    @cached_property
    def _world(self) -> NDArray[np.float64]:
        return rigid.transform(self.world_from_sensor, self.points)

    @cached_property
    def _columns(self) -> NDArray[np.float32]:
        """The obstacles (M, 3), sensor coordinates, laid out column by column."""
        return np.asfortranarray(self.points, dtype=np.float32)

    def world_at_stamp(
        self, picked: NDArray[np.int64], velocity: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """As `world`, but where a thing of that velocity (3,) had those points at the stamp."""
        return self.world(picked) - self.seconds[picked, None] * velocity

    def seconds_at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """When after the stamp the sweep passed points (N, 3), sensor coordinates: (N,) seconds."""
        if not self.is_timed:
            return np.zeros(len(points))
        x, y = points[:, 0] - self.viewpoint[0], points[:, 1] - self.viewpoint[1]
        return self.seconds_by_azimuth[azimuth_bins(x, y)]

    @cached_property
    def is_timed(self) -> bool:
        """Whether it is known when each point was met."""
        return bool(self.seconds.any())

    @cached_property
    def seconds_by_azimuth(self) -> NDArray[np.float64]:
        """(`AZIMUTH_BINS`,) seconds after the stamp at which the sweep passed each direction."""
        x, y = self.level
        bins = azimuth_bins(x - self.viewpoint[0], y - self.viewpoint[1])
        counts = np.bincount(bins, minlength=AZIMUTH_BINS)
        sums = np.bincount(bins, self.seconds, minlength=AZIMUTH_BINS)
        full = np.flatnonzero(counts)
        about = np.concatenate([full - AZIMUTH_BINS, full, full + AZIMUTH_BINS])
        means = np.tile(sums[full] / counts[full], 3)
        wanted = np.arange(AZIMUTH_BINS)
        after = np.searchsorted(about, wanted)
        before = after - 1
        nearest = np.where(about[after] - wanted < wanted - about[before], after, before)
        return np.asarray(means[nearest])

    def in_clusters_of(self, picked: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which obstacles (M,) are in the clusters of some of them (K,)."""
        is_theirs = np.zeros(len(self.segment_sizes), dtype=np.bool_)
        is_theirs[self.segments[picked]] = True
        return is_theirs[self.segments]

    def about(self, centre: NDArray[np.float64], reach_m: float) -> NDArray[np.int64]:
        """The obstacles (K,) in the level square so far about a place (3,) in the world."""
        here = self.sensor_from_world[:3] @ np.append(centre, 1.0)
        (x, y), (east, north) = self.level, here[:2]
        near = (x > east - reach_m) & (x < east + reach_m)
        near &= (y > north - reach_m) & (y < north + reach_m)
        return np.flatnonzero(near)

    @cached_property
    def near_world(self) -> NDArray[np.float64]:
        """Obstacles and low points in the world, (M + L, 3) metres."""
        return rigid.transform(self.world_from_sensor, self.near_points)

    @cached_property
    def close_world(self) -> NDArray[np.float64]:
        """Close points in the world, (C, 3) metres."""
        return rigid.transform(self.world_from_sensor, self.close_points)

    @cached_property
    def ground(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The level places of ``ground_rows``, x (G,) and y (G,), metres, sensor coordinates."""
        x, y = self.registered.frame.points.T[:2].take(self.ground_rows, axis=1)
        return x, y

    def watch(self, other: SightedFrame) -> None:
        """Count what this frame saw at the other frame's obstacles."""
        sensor_from_other = self.sensor_from_world @ other.world_from_sensor
        sighting = self.view.look(other._columns, sensor_from_other)
        other.through += sighting.through
        other.met += sighting.met
        other._watched_at.append(self.stamp)

    def outlasts(self, picked: NDArray[np.int64], seconds: float) -> NDArray[np.bool_]:
        """Which of some obstacles (K,) are at a place where something was for longer than that.

        Nobody saw through it, and more frames met something there, by `OUTLASTS_BY`, than any such
        time about this frame's stamp has. What moves is gone when it has gone its length.
        """
        at = np.array(self._watched_at) - self.stamp
        starts = np.append(at[(at <= 0) & (at >= -seconds)], 0.0)[:, None]
        most = ((at >= starts) & (at <= starts + seconds)).sum(axis=1).max()
        return (self.through[picked] == 0) & (self.met[picked] > most + OUTLASTS_BY)


def _picked(points: NDArray[np.float32], rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Some of the points (N, 3), laid out column by column, row by row (K, 3)."""
    return np.ascontiguousarray(points.T.take(rows, axis=1).T, dtype=np.float64)


def height_weight(
    x: NDArray[Any], y: NDArray[Any], gap: float | NDArray[np.float64]
) -> NDArray[np.float64]:
    """What heights count in distances, (...) each, at x and y (...) from sensors.

    ``gap`` is the angle between their beams, radians, (...) or one for all.
    """
    spacing = gap * np.sqrt(x * x + y * y)
    return np.minimum(HEIGHT_WEIGHT, BEAM_ALLOWANCE_M / np.maximum(spacing, 1e-3))


def azimuth_bins(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which of `AZIMUTH_BINS` directions, all round, each of x and y (...) lies in."""
    angle = np.arctan2(y.astype(np.float32), x.astype(np.float32))
    bins = (angle * np.float32(AZIMUTH_BINS / (2 * np.pi))).astype(np.int64)
    bins[bins < 0] += AZIMUTH_BINS
    return bins
