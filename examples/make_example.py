"""Makes the shipped example, ``examples/street``: ten frames of a simulated street.

Usage: python examples/make_example.py [FOLDER]

The seed was chosen for what is in view in every frame: two moving cars or more, a cyclist, and a
pedestrian who walks (``python examples/make_example.py --search`` lists such seeds). To stay small,
every fourth column of the sensor's is kept.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame, Labels
from lidaraccum.io.labelled import LabelledSettings, write_labelled_sequence
from lidaraccum.simulation.drive import DriveSettings, SimulatedSequence, simulate

EXAMPLE = DriveSettings(
    seed=36,
    frames=10,
    sensor="HDL-64E",
    rate_hz=10.0,
    scene="straight",
    speed_mps=8.0,
    manoeuvre="cruise",
    rolling_shutter=True,
    compensated=False,
    coordinates="sensor",
    weather="clear",
    zeros=False,
)
KEPT_COLUMNS = 4
GRID_M = 2.0**-10
"""Places in the labels are rounded to this, like those in LAZ, so that they compress."""
NEAR_M = 25.0
ENOUGH = 60


class Thinned:
    """A simulated drive with every few columns kept."""

    def __init__(self, drive: SimulatedSequence) -> None:
        self.drive = drive
        self.name = drive.name
        self.rate_hz = drive.rate_hz
        self.poses = drive.poses
        self.crs_wkt = drive.crs_wkt

    def __len__(self) -> int:
        return len(self.drive)

    def _kept(self, index: int) -> NDArray[np.int64]:
        offset = self.drive[index].time_offset
        columns = self.drive.drawn.sensor.columns_at(self.rate_hz)
        column = np.round((offset * self.rate_hz + 0.5) * columns - 0.5).astype(int)
        return np.flatnonzero(column % KEPT_COLUMNS == 0)

    def __getitem__(self, index: int) -> Frame:
        frame, kept = self.drive[index], self._kept(index)
        return replace(
            frame,
            points=frame.points[kept],
            intensity=frame.intensity[kept],
            time_offset=frame.time_offset[kept],
            ring=frame.ring[kept].astype(np.uint8),
            row_count=-1,
        )

    def labels(self, index: int) -> Labels:
        """The truth about the kept points."""
        labels, kept = self.drive.labels(index), self._kept(index)
        return replace(
            labels,
            foreground=labels.foreground[kept],
            dynamic=labels.dynamic[kept],
            instance=labels.instance[kept],
            annotated=labels.annotated[kept],
            semantic=labels.semantic[kept].astype(np.uint8),
            points_at_stamp=np.round(labels.points_at_stamp[kept] / GRID_M) * GRID_M,
        )


def movers_in_view(labels: Labels) -> list[str]:
    """Categories of the movers that many points of a frame lie on, not far away."""
    counts = np.bincount(
        labels.instance, minlength=max((box.id for box in labels.boxes), default=0) + 1
    )
    return [
        box.category
        for box in labels.boxes
        if box.dynamic
        and counts[box.id] >= ENOUGH
        and np.linalg.norm(box.sensor_from_object[:2, 3]) < NEAR_M
    ]


def is_fit(drive: SimulatedSequence) -> bool:
    """Whether two moving cars, a cyclist and a walker are in view from first to last."""
    for index in (0, len(drive) // 2, len(drive) - 1):
        seen = movers_in_view(drive.labels(index))
        if seen.count("Car") < 2 or "Cyclist" not in seen or "Pedestrian" not in seen:
            return False
    return True


def search(seeds: range) -> None:
    """Print the seeds whose drive shows what the example should."""
    for seed in seeds:
        drive = simulate(replace(EXAMPLE, seed=seed))
        kinds = [actor.model.category for actor in drive.actors]
        if {"Car", "Cyclist", "Pedestrian"} <= set(kinds) and is_fit(drive):
            print(seed, movers_in_view(drive.labels(5)), flush=True)


def main() -> None:
    """Write the example, or look for its seed."""
    arguments = sys.argv[1:]
    if arguments == ["--search"]:
        search(range(400))
        return
    folder = Path(arguments[0]) if arguments else Path(__file__).parent / "street"
    notes = {"made by": "examples/make_example.py", "columns": f"every {KEPT_COLUMNS}th"}
    how = LabelledSettings(
        format="laz", sensor="HDL-64E", licence="MIT; simulated", notes=notes, overwrite=True
    )
    write_labelled_sequence(folder, Thinned(simulate(EXAMPLE)), how)


if __name__ == "__main__":
    main()
