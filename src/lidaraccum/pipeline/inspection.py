"""A look at a sequence before anything is done with it: what is in the frames."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from lidaraccum.data.frame import Frame
from lidaraccum.data.sequence import Sequence

SAMPLE_FRAMES = 10
"""Frames that are read for a look, evenly over the sequence."""

ELEVATION_BIN_DEG = 0.02
KNOWN_SENSORS = {
    "Velodyne VLP-16": (16, -15.0, 15.0),
    "Velodyne HDL-32E": (32, -30.67, 10.67),
    "Velodyne VLP-32C": (32, -25.0, 15.0),
    "Velodyne HDL-64E": (64, -24.9, 2.0),
    "Hesai Pandar64": (64, -25.0, 15.0),
    "Hesai Pandar40P": (40, -25.0, 15.0),
    "Ouster OS1-64": (64, -22.5, 22.5),
    "Ouster OS1-128": (128, -22.5, 22.5),
    "Ouster OS0-128": (128, -45.0, 45.0),
    "Ouster OS2-128": (128, -11.25, 11.25),
}
"""Beams, lowest and highest elevation in degrees, as their data sheets say."""


@dataclass(frozen=True)
class Inspection:
    """What a few frames of a sequence show.

    Attributes:
        sampled: Frames that were read.
        points_per_frame: Median number of points.
        without_return: Share of points that mean "no return".
        dropped: Share of points that were not finite.
        fields: What comes with the points.
        extent_m: ((xmin, ymin, zmin), (xmax, ymax, zmax)) of the sampled points, in the file's
            coordinates.
        median_range_m: Median distance from the sensor.
        elevation_deg: Lowest and highest beam, (1st and 99th percentile of elevation).
        beams: Number of beams, 0 where it cannot be told.
        sensor: Known sensor that this looks like, or empty.
    """

    sampled: int
    points_per_frame: int
    without_return: float
    dropped: float
    fields: tuple[str, ...]
    extent_m: tuple[tuple[float, ...], tuple[float, ...]]
    median_range_m: float
    elevation_deg: tuple[float, float]
    beams: int
    sensor: str


def inspect(sequence: Sequence, sample: int = SAMPLE_FRAMES) -> Inspection:
    """Read a few frames, evenly over the sequence, and say what is in them."""
    indices = np.unique(np.linspace(0, len(sequence) - 1, min(sample, len(sequence))).astype(int))
    frames = [sequence[index] for index in indices.tolist()]
    file_rows = sum(frame.row_count for frame in frames)
    points = [frame.points[frame.returned] for frame in frames]
    ranges = np.concatenate([np.linalg.norm(part, axis=1) for part in points])
    elevations = [elevation_deg(part) for part in points]
    lowest, highest = np.percentile(np.concatenate(elevations), [0.5, 99.5]).tolist()
    beams = count_beams(frames[0], elevations[0])
    return Inspection(
        sampled=len(frames),
        points_per_frame=int(np.median([frame.row_count for frame in frames])),
        without_return=sum(len(f) - len(p) for f, p in zip(frames, points, strict=True))
        / file_rows,
        dropped=sum(frame.row_count - len(frame) for frame in frames) / file_rows,
        fields=fields_of(frames[0]),
        extent_m=_extent(frames),
        median_range_m=float(np.median(ranges)),
        elevation_deg=(lowest, highest),
        beams=beams,
        sensor=guess_sensor(beams, lowest, highest),
    )


def fields_of(frame: Frame) -> tuple[str, ...]:
    """Names of what comes with a frame's points."""
    known = {
        "intensity": frame.intensity,
        "ring": frame.ring,
        "time_offset": frame.time_offset,
    }
    own = [name for name, values in known.items() if values is not None]
    return ("x", "y", "z", *own, *frame.attributes)


def elevation_deg(points: NDArray[np.float32]) -> NDArray[np.float64]:
    """Elevation (N,) of points (N, 3) as the sensor sees them, degrees."""
    horizontal = np.hypot(points[:, 0], points[:, 1])
    return np.degrees(np.arctan2(points[:, 2], horizontal)).astype(np.float64)


def count_beams(frame: Frame, elevation: NDArray[np.float64]) -> int:
    """Number of beams: by ring where the file says, otherwise by peaks of elevation.

    A spinning beam draws a cone, so its points share one elevation; frames without that (fused,
    georeferenced, solid-state) have no such peaks and the answer is 0.
    """
    if frame.ring is not None:
        return len(np.unique(frame.ring))
    if frame.origin.any() or len(elevation) < 1000:
        return 0
    if np.ptp(elevation) < ELEVATION_BIN_DEG:
        return 1
    bins = np.arange(elevation.min(), elevation.max() + ELEVATION_BIN_DEG, ELEVATION_BIN_DEG)
    counts, _ = np.histogram(elevation, bins)
    smooth = np.convolve(np.convolve(counts, np.ones(5) / 5), np.ones(3) / 3, mode="same")
    peaks, _ = find_peaks(smooth, prominence=0.25 * smooth.mean())
    found = len(peaks)
    in_peaks = counts[counts > counts.mean()].sum() / max(counts.sum(), 1)
    return found if in_peaks > 0.6 else 0


def guess_sensor(beams: int, lowest_deg: float, highest_deg: float) -> str:
    """The known sensor nearest in beams and field of view, or an empty text."""
    best, distance = "", 6.0
    for name, (known_beams, low, high) in KNOWN_SENSORS.items():
        if not 0.75 * known_beams <= beams <= 1.25 * known_beams:
            continue
        # The ground hides nothing of the lowest beam, the sky much of the highest.
        apart = abs(low - lowest_deg) + 0.3 * abs(high - highest_deg)
        if apart < distance:
            best, distance = name, apart
    return best


def _extent(frames: Items[Frame]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    low = np.min([frame.points.min(axis=0) + frame.origin for frame in frames], axis=0)
    high = np.max([frame.points.max(axis=0) + frame.origin for frame in frames], axis=0)
    return tuple(low.tolist()), tuple(high.tolist())
