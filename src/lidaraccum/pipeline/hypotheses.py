"""Where a suspect may have gone: velocities worth trying on the points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lidaraccum.geometry import rigid
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.suspects import Suspect, Template, template_of

MAX_SHIFTS = 8
"""Centroid shifts that are tried, the shortest first."""

SIZE_RATIO = 4.0
"""Two clusters with more than so many times the other's points are not one thing."""

VOTE_BIN_M = 0.1
VOTE_REACH_M = 8.0
VOTE_PEAKS = 2
VOTE_POINTS = 60
VOTE_HEIGHT_M = 0.3
"""Differences between points of like height, in bins, as ICP-Flow (Lin & Caesar, CVPR 2024)."""


def propose(
    suspect: Suspect,
    suspects: Sequence[Suspect],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> NDArray[np.float64]:
    """Velocities (H, 3) in the world, m/s, level, that might explain the suspect."""
    proposals = centroid_shifts(suspect, suspects, frames, settings)
    template = template_of(frames[suspect.frame], suspect.picked, VOTE_POINTS)
    for place in (suspect.frame - 1, suspect.frame + 1):
        if 0 <= place < len(frames):
            proposals += vote_peaks(template, frames[place], settings)
    return np.array(proposals).reshape(-1, 3)


def centroid_shifts(
    suspect: Suspect,
    suspects: Sequence[Suspect],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> list[NDArray[np.float64]]:
    """Velocities to the centres of like suspects in the two frames before and after."""
    near = [
        other
        for other in suspects
        if 0 < abs(other.frame - suspect.frame) <= 2
        and 1 / SIZE_RATIO < len(other) / len(suspect) < SIZE_RATIO
    ]
    if not near:
        return []
    seconds = np.array([frames[other.frame].stamp for other in near]) - frames[suspect.frame].stamp
    ways = (np.array([other.centre for other in near]) - suspect.centre) * (1.0, 1.0, 0.0)
    apart = seconds != 0
    velocities = ways[apart] / seconds[apart, None]
    speeds = np.linalg.norm(velocities, axis=1)
    order = np.argsort(speeds, kind="stable")[:MAX_SHIFTS]
    return list(velocities[order[speeds[order] < settings.max_speed_mps]])


def vote_peaks(
    template: Template, other: SightedFrame, settings: MotionSettings
) -> list[NDArray[np.float64]]:
    """Velocities by which most points of a suspect would fall on seen-through ones."""
    seconds = other.stamp - template.stamp
    reach = min(settings.max_speed_mps * abs(seconds), VOTE_REACH_M)
    votes = _differences(template, other, reach)
    bins = int(2 * reach / VOTE_BIN_M)
    cells = np.floor((votes + reach) / VOTE_BIN_M).astype(np.int64)
    cells = cells[((cells >= 0) & (cells < bins)).all(axis=1)]
    if len(cells) == 0:
        return []
    counts = np.bincount(cells[:, 0] * bins + cells[:, 1], minlength=bins * bins)
    heap = ndimage.uniform_filter(counts.reshape(bins, bins).astype(np.float64), size=3)
    found = []
    for _ in range(VOTE_PEAKS):
        row, column = divmod(int(heap.argmax()), bins)
        shift = np.array([row + 0.5, column + 0.5, 0.0]) * VOTE_BIN_M - (reach, reach, 0.0)
        found.append(other.world_from_sensor[:3, :3] @ shift * (1.0, 1.0, 0.0) / seconds)
        heap[max(row - 4, 0) : row + 5, max(column - 4, 0) : column + 5] = 0
    return found


def _differences(template: Template, other: SightedFrame, reach: float) -> NDArray[np.float64]:
    """Level differences (V, 2) from template points to suspicious points of like height."""
    local = rigid.transform(other.sensor_from_world, template.world)
    centre = local.mean(axis=0)
    radius = reach + np.linalg.norm(local - centre, axis=1).max()
    rows = np.flatnonzero(other.through)
    away = ((other.points[rows, :2] - centre[:2]) ** 2).sum(axis=1)
    rows = rows[away < radius**2]
    rows = rows[:: len(rows) // (5 * VOTE_POINTS) + 1]
    differences = other.points[rows][None, :, :2] - local[:, None, :2]
    alike = np.abs(other.heights[rows][None] - template.heights[:, None]) < VOTE_HEIGHT_M
    return differences[alike]
