"""What a run did and how far it can be trusted, for ``out.report.json`` and the summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lidaraccum.data.accumulation import BACKGROUND, MOVING, STILL, AccumulatedFrame
from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.geometry import rigid

DOUBTS_SHOWN = 5


@dataclass(frozen=True)
class FrameDoubt:
    """A frame whose pose should be looked at, and why."""

    frame: int
    name: str
    doubts: tuple[str, ...]


@dataclass(frozen=True)
class AccumulationReport:
    """The whole run in figures.

    Attributes:
        version: Of lidaraccum.
        versions: Of the packages that decide results.
        sequence: Name of the input.
        settings: What was asked for, flat, by option name.
        weights: Hash of the network's weights, or None where no network ran.
        frames: Frames read.
        points_read: Points in the files.
        points_written: Points in the output.
        points_dropped: Points that were not finite.
        points_without_return: Points at the sensor's own place, "no return" written as zeros.
        background: Points written that are background.
        still: Points written on what can move but stands.
        moving: Points written on what moves.
        objects: Objects found.
        trajectory_m: Length of the sensor's way.
        median_residual_m: Median over frames of the point-to-plane distance to the map.
        lowest_overlap: Of any frame with the map.
        deskewed_frames: Frames whose rolling shutter was undone.
        doubtful: Frames whose pose is doubtful.
        stage_seconds: Wall time by stage.
        warnings: All that was said aloud.
    """

    version: str
    versions: Mapping[str, str]
    sequence: str
    settings: Mapping[str, Any]
    weights: str | None
    frames: int
    points_read: int
    points_written: int
    points_dropped: int
    points_without_return: int
    background: int
    still: int
    moving: int
    objects: int
    trajectory_m: float
    median_residual_m: float
    lowest_overlap: float
    deskewed_frames: int
    doubtful: tuple[FrameDoubt, ...]
    stage_seconds: Mapping[str, float]
    warnings: tuple[str, ...]


@dataclass
class FrameTally:
    """Counts as the frames go by."""

    points_read: int = 0
    points_dropped: int = 0
    points_without_return: int = 0
    points_by_label: dict[int, int] = field(
        default_factory=lambda: {BACKGROUND: 0, STILL: 0, MOVING: 0}
    )
    poses: list[rigid.Pose] = field(default_factory=list)
    overlaps: list[float] = field(default_factory=list)
    residuals_m: list[float] = field(default_factory=list)
    deskewed_frames: int = 0
    doubtful: list[FrameDoubt] = field(default_factory=list)

    def count_frame(self, frame: Frame) -> None:
        """A frame was read."""
        self.points_read += frame.row_count
        self.points_dropped += frame.row_count - len(frame)
        self.points_without_return += int(np.count_nonzero(~frame.returned))

    def count_registration(self, registered: RegisteredFrame) -> None:
        """A frame found its place."""
        quality = registered.quality
        self.poses.append(registered.world_from_sensor)
        if registered.index:
            self.overlaps.append(quality.overlap)
            self.residuals_m.append(quality.residual_m)
        self.deskewed_frames += registered.deskewed
        if quality.doubts:
            self.doubtful.append(
                FrameDoubt(registered.index, registered.frame.name, quality.doubts)
            )

    def count_output(self, frame: AccumulatedFrame) -> None:
        """A frame's share goes out."""
        labels, counts = np.unique(frame.label, return_counts=True)
        for label, count in zip(labels.tolist(), counts.tolist(), strict=True):
            self.points_by_label[label] += count

    @property
    def trajectory_m(self) -> float:
        """Length of the sensor's way so far."""
        steps = np.diff([pose[:3, 3] for pose in self.poses], axis=0)
        return float(np.linalg.norm(steps, axis=1).sum()) if len(self.poses) > 1 else 0.0

    def warnings(self) -> tuple[str, ...]:
        """What the user must hear about, a sentence each."""
        said = []
        if self.points_dropped:
            said.append(f"{self.points_dropped} points were not finite and were dropped")
        if self.points_without_return:
            said.append(
                f"{self.points_without_return} points at the sensor's own place mean "
                "'no return'; they are kept but took no part in registration"
            )
        for doubt in self.doubtful[:DOUBTS_SHOWN]:
            said.append(f"the pose of frame {doubt.frame} is doubtful: {'; '.join(doubt.doubts)}")
        if len(self.doubtful) > DOUBTS_SHOWN:
            said.append(f"doubtful poses beyond these: {len(self.doubtful) - DOUBTS_SHOWN}")
        return tuple(said)
