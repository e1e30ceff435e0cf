"""Moving points as dufomap finds them with the true poses given, on the windows of `evaluate`.

Usage: pip install dufomap; python scripts/compare_dufomap.py DIR|simulated:N [--window 5]
           [--half-width 32]

dufomap 1.1.1 in its own settings (0.1 m voxels, d_s 0.2 m, d_p 2), told the true poses. It labels
all frames of a window after having seen them all. A window of 0 takes the whole sequence at once.
"""

from __future__ import annotations

import argparse
import logging
import sys
import time
from collections.abc import Iterator

import numpy as np
from dufomap import dufomap
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray
from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.data.window import Window, windows
from lidaraccum.evaluation.truth import Scope, window_truth
from lidaraccum.geometry import rigid
from lidaraccum.io.sequences import open_sequence
from lidaraccum.metrics.segmentation import SegmentationCounts, compare
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.windows import held_out_numbers, held_out_settings

VOXEL_M, HIT_INFLATION_M, UNKNOWN_INFLATION = 0.1, 0.2, 2


def main() -> None:
    """Score windows and say what came out."""
    logging.disable(logging.WARNING)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source")
    parser.add_argument("--window", type=int, default=5)
    parser.add_argument("--half-width", type=float, default=32.0)
    asked = parser.parse_args()
    counts, seconds, number = SegmentationCounts(), 0.0, 0
    for sequence in sequences(asked.source):
        length = asked.window or len(sequence)
        for window in windows(sequence, length, length):
            start = time.perf_counter()
            moving = moving_points(window, window.true_poses)
            seconds += time.perf_counter() - start
            truth = window_truth(window, Scope(asked.half_width))
            for said, true in zip(moving, truth.frames, strict=True):
                counts += compare(said[true.scored], true.dynamic[true.scored])
            number += 1
    sys.stdout.write(
        f"dufomap, poses given, {number} windows of {asked.window or 'all'} frames: "
        f"P {100 * counts.precision:.1f} R {100 * counts.recall:.1f} "
        f"IoU {100 * counts.iou:.1f}, {seconds / number:.2f} s a window\n"
    )


def sequences(source: str) -> Iterator[LabelledSequence]:
    """The labelled folder, or windows of the simulated test set as `evaluate --simulated` has."""
    kind, colon, count = source.partition(":")
    if not (kind == "simulated" and colon):
        yield open_sequence(source)
        return
    for number in held_out_numbers(int(count)):
        yield simulate(held_out_settings(number))


def moving_points(window: Window, world_from_sensor: NDArray[np.float64]) -> list[BoolArray]:
    """Which points (N,) of each frame move, by dufomap."""
    mapper = dufomap(VOXEL_M, HIT_INFLATION_M, UNKNOWN_INFLATION, num_threads=1)
    first_from_sensor = rigid.invert(world_from_sensor[0]) @ world_from_sensor
    for frame, pose in zip(window, first_from_sensor, strict=True):
        mapper.run(frame.points[frame.returned], pose, cloud_transform=True)
    mapper.oncePropagateCluster(if_propagate=True, if_cluster=False)
    found = []
    for frame, pose in zip(window, first_from_sensor, strict=True):
        moving = np.zeros(len(frame), dtype=np.bool_)
        labels = mapper.segment(frame.points[frame.returned], pose, cloud_transform=True)
        moving[frame.returned] = np.asarray(labels) == 1
        found.append(moving)
    return found


if __name__ == "__main__":
    main()
