"""Makes the shipped example, ``examples/street``: ten frames of a simulated street.

Usage: python examples/make_example.py [FOLDER]

The seed was chosen among the first few hundred for what is in view: two moving cars, a cyclist and
a pedestrian who walks (``python examples/make_example.py --search`` lists such seeds).
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidaraccum.data.frame import Labels
from lidaraccum.io.labelled import LabelledSettings, write_labelled_sequence
from lidaraccum.simulation.drive import DriveSettings, SimulatedSequence, simulate

EXAMPLE = DriveSettings(
    seed=0,
    frames=10,
    sensor="VLP-32C",
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
NEAR_M = 28.0
ENOUGH = 25


def movers_in_view(labels: Labels) -> list[str]:
    """Categories of the movers that many points of a frame lie on, not far away."""
    counts = np.bincount(labels.instance)
    return [
        box.category
        for box in labels.boxes
        if box.dynamic
        and box.id < len(counts)
        and counts[box.id] >= ENOUGH
        and np.linalg.norm(box.sensor_from_object[:2, 3]) < NEAR_M
    ]


def is_fit(drive: SimulatedSequence) -> bool:
    """Whether two moving cars, a cyclist and a walker are in view in all of its frames."""
    for index in (0, len(drive) // 2, len(drive) - 1):
        seen = movers_in_view(drive.labels(index))
        if seen.count("Car") < 2 or "Cyclist" not in seen or "Pedestrian" not in seen:
            return False
    return True


def search(seeds: range) -> list[int]:
    """Seeds whose drive shows what the example should."""
    return [seed for seed in seeds if is_fit(simulate(replace(EXAMPLE, seed=seed)))]


def main() -> None:
    """Write the example, or look for its seed."""
    arguments = sys.argv[1:]
    if arguments == ["--search"]:
        print(search(range(400)))
        return
    folder = Path(arguments[0]) if arguments else Path(__file__).parent / "street"
    write_labelled_sequence(
        folder,
        simulate(EXAMPLE),
        LabelledSettings(
            format="laz", sensor=EXAMPLE.sensor or "", licence="MIT; simulated", overwrite=True
        ),
    )


if __name__ == "__main__":
    main()
