"""What lies beside the cloud: poses, objects and the report, as text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import metadata
from typing import Any

import numpy as np

import lidaraccum
from lidaraccum.data.accumulation import BACKGROUND, MOVING, STILL, ObjectTrack
from lidaraccum.io.sequences import FileSequence
from lidaraccum.pipeline.accumulator import Accumulator
from lidaraccum.pipeline.report import AccumulationReport

DECIDING_PACKAGES = ("numpy", "scipy", "laspy", "plyfile")
"""The packages whose version may change a result."""


def _deciding(accumulator: Accumulator) -> tuple[str, ...]:
    return (*DECIDING_PACKAGES, "torch") if accumulator.weights else DECIDING_PACKAGES


def objects_json(tracks: Iterable[ObjectTrack]) -> dict[str, Any]:
    """What ``out.objects.json`` holds: each object and its motions."""
    return {
        "objects": [
            {
                "instance": track.instance,
                "moving": track.moving,
                "points": track.points,
                "confidence": round(track.confidence, 4),
                "velocity_mps": track.velocity.tolist(),
                "speed_mps": float(np.linalg.norm(track.velocity)),
                "size_lwh": list(track.size_lwh),
                "frames": sorted(track.reference_from_frame),
                "reference_from_frame": {
                    str(frame): motion.ravel().tolist()
                    for frame, motion in sorted(track.reference_from_frame.items())
                },
            }
            for track in tracks
        ]
    }


def report_of(
    sequence: FileSequence, accumulator: Accumulator, settings: Mapping[str, Any]
) -> AccumulationReport:
    """The report of a run that is through, without the time for the files that hold it."""
    tally = accumulator.tally
    return AccumulationReport(
        version=lidaraccum.__version__,
        versions={name: metadata.version(name) for name in _deciding(accumulator)},
        sequence=sequence.name,
        settings=dict(settings),
        weights=accumulator.weights,
        frames=len(tally.poses),
        points_read=tally.points_read,
        points_written=sum(tally.points_by_label.values()),
        points_dropped=tally.points_dropped,
        points_without_return=tally.points_without_return,
        background=tally.points_by_label[BACKGROUND],
        still=tally.points_by_label[STILL],
        moving=tally.points_by_label[MOVING],
        objects=len(accumulator.objects()),
        trajectory_m=tally.trajectory_m,
        median_residual_m=float(np.median(tally.residuals_m)),
        lowest_overlap=float(np.min(tally.overlaps)),
        deskewed_frames=tally.deskewed_frames,
        doubtful=tuple(tally.doubtful),
        stage_seconds=dict(accumulator.clock.seconds),
        warnings=(*sequence.info.warnings, *tally.warnings()),
    )
