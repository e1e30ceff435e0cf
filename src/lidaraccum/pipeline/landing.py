"""Where frames meet a cluster under many hypotheses at once: the inner loop of every verdict."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry.visibility import look_together
from lidaraccum.pipeline.freespace import AZIMUTH_BINS, SightedFrame, azimuth_bins, height_weight
from lidaraccum.pipeline.suspects import Template


class Lineup:
    """F frames of a window that meet a cluster: asked all at once, for arrays are small.

    Args:
        frames: At least one.
    """

    def __init__(self, frames: Sequence[SightedFrame]) -> None:
        self.frames = frames
        poses = np.array([frame.sensor_from_world for frame in frames]).reshape(-1, 4, 4)
        self._rotation = np.ascontiguousarray(poses[:, :3, :3].transpose(1, 0, 2))  # (3, F, 3)
        self._shift = np.ascontiguousarray(poses[:, :3, 3].T)  # (3, F)
        self._stamps = np.array([frame.stamp for frame in frames])
        self._gaps = np.array([frame.gap for frame in frames])[:, None, None]
        self._timed = np.array([frame.is_timed for frame in frames])

    @classmethod
    def beside(cls, template: Template, frames: Sequence[SightedFrame]) -> Lineup:
        """The frames of a window but the cluster's own."""
        return cls([frame for frame in frames if frame.stamp != template.stamp])

    def __len__(self) -> int:
        return len(self.frames)

    def seconds_after(self, template: Template) -> NDArray[np.float64]:
        """(F,) seconds from the cluster's stamp to the frames'."""
        return self._stamps - template.stamp

    def land(
        self, template: Template, velocities: NDArray[np.float64], turns: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Where the frames meet a cluster that moves, for each of H motions.

        Each is carried along its `courses.course` from stamp to stamp, and on by the time that the
        sweep takes to come by.

        Args:
            template: The cluster, P points.
            velocities: (H, 3) m/s, world, at the template's stamp.
            turns: (H,) radians a second.

        Returns:
            (3, F, H, P) metres, sensor coordinates: x, y and z in turn.
        """
        speeds = self._turned_here(velocities.T)
        if turns.any():
            local = self._on_courses(template, velocities, turns)
        else:
            start = self._turned_here(template.world.T) + self._shift[:, :, None]
            way = speeds * self.seconds_after(template)[:, None]
            local = start[:, :, None] + way[..., None]
        if self._timed.any():
            # A sweep takes time, and the mover goes on meanwhile.
            later = self._seconds_toward(local[0], local[1]) - template.seconds
            local += (speeds * self._timed[:, None])[..., None] * later
        return local

    def nearest(
        self, local: NDArray[np.float64], heights: NDArray[np.float64], reach_m: float
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Distance and row (F, H, P) of each landed point's nearest among its frame's near points.

        Args:
            local: (3, F, H, P) metres, sensor coordinates.
            heights: (P,) metres above the ground.
            reach_m: Distances beyond are inf, and their rows mean nothing.
        """
        x, y, _ = local
        places = np.empty((*x.shape, 3))
        places[..., 0], places[..., 1] = x, y
        np.multiply(height_weight(x, y, self._gaps), heights, out=places[..., 2])
        distance, row = np.empty(x.shape), np.empty(x.shape, dtype=np.int64)
        for number, frame in enumerate(self.frames):
            distance[number], row[number] = frame.tree.query(
                places[number], distance_upper_bound=reach_m
            )
        return distance, row

    def places_of(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Near points (3, F, H, P) by their rows (F, H, P), sensor coordinates; 0 without any."""
        found = np.zeros((*rows.shape, 3))
        for number, frame in enumerate(self.frames):
            if len(frame.near_points):
                found[number] = frame.near_points.take(rows[number], axis=0, mode="clip")
        return found.transpose(3, 0, 1, 2)

    def in_world(self, shifts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Shifts (3, F, H) in sensor coordinates, along the world's axes."""
        return np.einsum("afw,afh->wfh", self._rotation, shifts)

    def saw_through(
        self, local: NDArray[np.float64], asked: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Which landed points (3, F, H, P) of those asked (F, H, P) their frames saw through."""
        through = np.zeros_like(asked)
        views = [frame.view for frame in self.frames]
        counts = np.count_nonzero(asked, axis=(1, 2))
        through[asked] = look_together(views, local[:, asked], counts).through
        return through

    def _turned_here(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors (3, N), world, along each frame's axes (3, F, N)."""
        turned = self._rotation.reshape(-1, 3) @ vectors
        return turned.reshape(3, len(self), vectors.shape[1])

    def _on_courses(
        self, template: Template, velocities: NDArray[np.float64], turns: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The cluster (3, F, H, P), sensor coordinates, on each course: see `courses.course`."""
        seconds = self.seconds_after(template)[:, None]
        half = 0.5 * seconds * turns
        chord = seconds * np.sinc(half / np.pi)
        x, y, z = velocities.T
        centre = np.empty((3, *half.shape))
        centre[0] = (np.cos(half) * x - np.sin(half) * y) * chord
        centre[1] = (np.sin(half) * x + np.cos(half) * y) * chord
        centre[2] = z * chord
        centre += template.pivot[:, None, None]
        ahead, aside, up = self._rotation.transpose(2, 0, 1)[..., None]
        cosine, sine = np.cos(2 * half), np.sin(2 * half)
        turned = np.empty((3, *half.shape, 3))
        turned[..., 0] = ahead * cosine + aside * sine
        turned[..., 1] = aside * cosine - ahead * sine
        turned[..., 2] = up
        around = turned.reshape(-1, 3) @ (template.world - template.pivot).T
        here = np.einsum("afw,wfh->afh", self._rotation, centre) + self._shift[..., None]
        return around.reshape(3, *half.shape, -1) + here[..., None]

    def _seconds_toward(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """When after their stamps the sweeps passed x and y (F, H, P) each: seconds, as they."""
        bins = azimuth_bins(x - self._viewpoints[0], y - self._viewpoints[1])
        bins += np.arange(0, len(self) * AZIMUTH_BINS, AZIMUTH_BINS)[:, None, None]
        return self._seconds_by_azimuth.take(bins)

    @cached_property
    def _viewpoints(self) -> NDArray[np.float64]:
        """(3, F, 1, 1) metres, sensor coordinates."""
        return np.array([frame.viewpoint for frame in self.frames]).T[:, :, None, None]

    @cached_property
    def _seconds_by_azimuth(self) -> NDArray[np.float64]:
        return np.concatenate([frame.seconds_by_azimuth for frame in self.frames])
