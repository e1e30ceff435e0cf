"""How far off the ground is under labelled objects, by both estimates of it.

Usage: measure_ground.py [--windows 40] [--drive DIR]

The first frame of each window of the simulator's test set, or every sixth frame of a labelled
drive; objects within 31 m with 20 points or more. Where a box ends the ground should be.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lidaraccum.data.frame import Frame, Labels
from lidaraccum.evaluation.report_tables import Table
from lidaraccum.geometry import rigid
from lidaraccum.geometry.ground import estimate_ground
from lidaraccum.geometry.terrain import estimate_terrain
from lidaraccum.io.sequences import open_sequence
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.windows import held_out_numbers, held_out_settings

REACH_M, FEWEST_POINTS, EVERY = 31.0, 20, 6
BOUNDS_M = (0.1, 0.15, 0.3, 0.6)


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--windows", type=int, default=40)
    parser.add_argument("--drive", type=Path)
    options = parser.parse_args()
    errors = np.concatenate(
        [errors_of(*one) for one in labelled_frames(options.drive, options.windows)]
    )
    titles = ("ground", "objects", *(f"off by > {bound:g} m, %" for bound in BOUNDS_M))
    rows = [
        [name, str(len(off)), *(f"{100 * np.mean(off > bound):.1f}" for bound in BOUNDS_M)]
        for name, off in zip(("rough", "fine"), np.abs(errors).T, strict=True)
    ]
    print(Table("The ground under objects", titles, rows).markdown())


def labelled_frames(drive: Path | None, windows: int) -> Iterator[tuple[Frame, Labels]]:
    """Frames and the truth about them."""
    if drive:
        sequence = open_sequence(drive)
        for index in range(0, len(sequence), EVERY):
            yield sequence[index], sequence.labels(index)
        return
    for number in held_out_numbers(windows):
        simulated = simulate(held_out_settings(number))
        yield simulated[0], simulated.labels(0)


def errors_of(frame: Frame, labels: Labels) -> np.ndarray:
    """How far boxes end above the rough and the fine ground: (K, 2) metres."""
    poses = [
        box.sensor_from_object @ rigid.translation((0.0, 0.0, -0.5 * box.size_lwh[2]))
        for box in labels.boxes
        if np.count_nonzero(labels.instance == box.id) >= FEWEST_POINTS
    ]
    feet = np.array([pose[:3, 3] for pose in poses]).reshape(-1, 3)
    feet = feet[np.hypot(feet[:, 0], feet[:, 1]) < REACH_M]
    points = frame.points[frame.returned]
    rough = estimate_ground(points)
    above = rough.height_above(rigid.transform(rough.level_from_sensor, feet))
    return np.column_stack([above, estimate_terrain(points).height_above(feet)])


if __name__ == "__main__":
    main()
