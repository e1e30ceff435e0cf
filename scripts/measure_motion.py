"""How well movers are found, by geometry alone or led by the network, on a folder of frames.

Usage: python scripts/measure_motion.py DIR [--poses found|given] [--preset balanced]
           [--window T] [--apart] [--frames N] [--weights FILE]

Scores only ``annotated`` points where the labels say which. ``--apart`` cuts the sequence into
windows that share no frame and sees each alone. Sharpness is that of each true mover's accumulated
points (those found, of all frames): the median distance of a point to the surface that the other
frames' points make around it. The time is the processor's, of this stage alone.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.data.accumulation import MOVING
from lidaraccum.data.frame import Labels
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.data.registered import RegisteredFrame, RegistrationQuality
from lidaraccum.geometry import rigid
from lidaraccum.io.sequences import FileSequence, InputSettings, open_sequence
from lidaraccum.metrics.segmentation import SegmentationCounts, compare
from lidaraccum.model.reader import NetworkReader
from lidaraccum.pipeline.label_free import LabelFree
from lidaraccum.pipeline.motion_settings import AGGRESSIVE, BALANCED, CONSERVATIVE, MotionSettings
from lidaraccum.pipeline.network_led import NetworkLed
from lidaraccum.pipeline.perception import Perceiver
from lidaraccum.registration.odometry import RegistrationSettings, register

PRESETS = {"conservative": CONSERVATIVE, "balanced": BALANCED, "aggressive": AGGRESSIVE}
SURFACE_SAMPLES = 2000
SURFACE_NEIGHBOURS = 60
SURFACE_REACH_M = 0.15


def say(line: str) -> None:
    """A line to stdout."""
    sys.stdout.write(line + "\n")


class Stopwatch:
    """Seconds spent in the perceiver, less those spent in making its frames."""

    def __init__(self) -> None:
        self.outside = 0.0

    def around(self, frames: Iterable[RegisteredFrame]) -> Iterator[RegisteredFrame]:
        """Hand frames on; the time to make them is outside."""
        iterator = iter(frames)
        while True:
            start = time.process_time()
            try:
                frame = next(iterator)
            except StopIteration:
                return
            finally:
                self.outside += time.process_time() - start
            yield frame


def registered_frames(sequence: FileSequence, poses: str, count: int) -> Iterator[RegisteredFrame]:
    """The sequence's first frames with poses found by registration, or as given."""
    frames = (sequence[index] for index in range(count))
    if poses == "found":
        yield from register(frames, RegistrationSettings(), None)
        return
    given = sequence.poses
    if given is None:
        sys.exit(f"{sequence.name} has no poses")
    quality = RegistrationQuality("given", 1.0, 0.0)
    for index, frame in enumerate(frames):
        yield RegisteredFrame(index, frame, given[index], quality)


def sharpness(clouds: list[NDArray[np.float64]]) -> tuple[float, int]:
    """Median point-to-plane residual, metres, between frames of one object, and its points."""
    points = np.concatenate(clouds)
    frame = np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds])
    rng = np.random.default_rng(0)
    rows = rng.permutation(len(points))[:SURFACE_SAMPLES]
    residuals = []
    for row, about_row in zip(
        rows, cKDTree(points).query_ball_point(points[rows], SURFACE_REACH_M), strict=True
    ):
        others = np.array(about_row)
        kept = rng.permutation(others[frame[others] != frame[row]])[:SURFACE_NEIGHBOURS]
        if len(kept) < SURFACE_NEIGHBOURS // 2:
            continue
        about = points[kept]
        centre = about.mean(axis=0)
        normal = np.linalg.svd(about - centre)[2][2]
        residuals.append(abs(float((points[row] - centre) @ normal)))
    return (float(np.median(residuals)) if residuals else np.nan), len(points)


class Report:
    """Gathers what the perceived frames say beside the truth."""

    def __init__(self, sequence: FileSequence) -> None:
        self._sequence = sequence
        self._has_labels = True
        self.counts = SegmentationCounts()
        self.frames = 0
        self.moving = 0
        self.points = 0
        self.by_instance: dict[int, list[tuple[int, int, bool]]] = {}
        self.clouds: dict[int, list[NDArray[np.float64]]] = {}
        self.owners: dict[int, list[int]] = {}

    def add(self, perceived: PerceivedFrame) -> None:
        """Count one frame."""
        said = perceived.label == MOVING
        self.frames += 1
        self.moving += int(said.sum())
        self.points += len(said)
        for instance, pose in perceived.world_from_object.items():
            own = perceived.instance == instance
            registered = perceived.registered
            object_from_sensor = rigid.invert(pose) @ registered.world_from_sensor
            cloud = rigid.transform(object_from_sensor, registered.frame.points[own])
            self.clouds.setdefault(instance, []).append(cloud)
        if self._has_labels:
            try:
                labels = self._sequence.labels(perceived.registered.index)
            except Exception:
                self._has_labels = False
                return
            self._compare(perceived, said, labels)

    def _compare(self, perceived: PerceivedFrame, said: NDArray[np.bool_], labels: Labels) -> None:
        scored = labels.annotated if labels.annotated is not None else np.ones(len(said), bool)
        self.counts += compare(said[scored], labels.dynamic[scored])
        for instance in np.unique(labels.instance[scored]):
            if instance == 0:
                continue
            own = scored & (labels.instance == instance)
            self.by_instance.setdefault(int(instance), []).append(
                (int(own.sum()), int(said[own].sum()), bool(labels.dynamic[own].mean() > 0.5))
            )
            found = perceived.instance[own & said]
            if len(found):
                owner = int(np.bincount(found).argmax())
                self.owners.setdefault(int(instance), []).append(owner)

    def tell(self) -> None:
        """The figures."""
        say(f"called moving: {100 * self.moving / self.points:.2f} % of {self.frames} frames")
        if not self.counts.true_negative:
            return
        false = self.counts.false_positive + self.counts.true_negative
        say(
            f"annotated points: IoU {self.counts.iou:.3f}  P {self.counts.precision:.3f}  "
            f"R {self.counts.recall:.3f}  standing points called moving "
            f"{100 * self.counts.false_positive / false:.3f} %"
        )
        for instance, frames in sorted(self.by_instance.items()):
            points, found, dynamic = np.array(frames).sum(axis=0)
            line = f"object {instance}: {len(frames)} frames, {points} points, "
            line += f"moving in {dynamic}, found {100 * found / points:.1f} %"
            owners = self.owners.get(instance, [])
            if owners:
                ids, times = np.unique(owners, return_counts=True)
                line += f", ids {dict(zip(ids.tolist(), times.tolist(), strict=True))}"
                residual, size = sharpness(self.clouds[int(ids[times.argmax()])])
                line += f", sharp to {100 * residual:.1f} cm ({size} points)"
            say(line)


def _perceiver(settings: MotionSettings, reader: NetworkReader | None) -> Perceiver:
    return NetworkLed(reader, settings) if reader else LabelFree(settings)


def main() -> None:
    """Parse, run, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory")
    parser.add_argument("--poses", choices=("found", "given"), default="found")
    parser.add_argument("--preset", choices=sorted(PRESETS), default="balanced")
    parser.add_argument("--window", type=int, default=0)
    parser.add_argument("--apart", action="store_true")
    parser.add_argument("--frames", type=int, default=0)
    parser.add_argument("--weights", type=Path)
    options = parser.parse_args()
    sequence = open_sequence(
        options.directory, InputSettings(poses="auto" if options.poses == "given" else "")
    )
    count = min(len(sequence), options.frames or len(sequence))
    preset = PRESETS[options.preset]
    window = min(options.window or preset.window, count)
    settings = replace(preset, window=window, stride=min(preset.stride, (window - 1) // 2 or 1))
    frames = registered_frames(sequence, options.poses, count)
    reader = NetworkReader.open(options.weights) if options.weights else None
    report, watch = Report(sequence), Stopwatch()
    start = time.process_time()
    if options.apart:
        batch = list(frames)
        watch.outside += time.process_time() - start
        for first in range(0, count, window):
            for perceived in _perceiver(settings, reader).perceive(batch[first : first + window]):
                report.add(perceived)
    else:
        perceived_frames = _perceiver(settings, reader).perceive(watch.around(frames))
        for perceived in perceived_frames:
            pause = time.process_time()
            report.add(perceived)
            watch.outside += time.process_time() - pause
    seconds = time.process_time() - start - watch.outside
    report.tell()
    say(f"{1000 * seconds / count:.0f} ms a frame")


if __name__ == "__main__":
    main()
