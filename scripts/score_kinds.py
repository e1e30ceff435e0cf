"""What weights miss of what can move, by kind and distance, on frames of the simulated test set.

Usage: score_kinds.py WEIGHTS [--windows 200] [--extent 64]

Each window's middle frame by itself, sweeps compensated: points within the grid whose pillar is
more likely movable than not. Prints foreground over all points and as a mean of windows that show
more than 200 movable points, then the recall of each kind by the median distance of its object.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from lidaraccum.evaluation.report_tables import Table
from lidaraccum.metrics.segmentation import SegmentationCounts, compare
from lidaraccum.model.batch import prepare, to_tensors
from lidaraccum.model.checkpoint import load_network
from lidaraccum.model.network import Network
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.windows import held_out_numbers, held_out_settings

EDGES_M = (4.0, 8.0, 20.0)
FEWEST_POINTS = 200
RANGES = ("below 4 m", "4 to 8 m", "8 to 20 m", "from 20 m")

Tally = defaultdict[tuple[str, int], NDArray[np.int64]]


def score(network: Network, number: int, extent_m: float, tally: Tally) -> SegmentationCounts:
    """Score a window's middle frame; add the found and all points of each kind and range."""
    drive = simulate(replace(held_out_settings(number), compensated=True))
    frame, labels = drive[len(drive) // 2], drive.labels(len(drive) // 2)
    prepared = prepare(frame, network.settings, extent_m)
    with torch.no_grad():
        features = network.encode(to_tensors([prepared]), matchable=False)
    assert labels.annotated is not None
    rows = prepared.rows
    told = labels.annotated[rows]
    found = (features.foreground[features.frames.pillar] > 0).numpy()[told]
    movable, owner = labels.foreground[rows][told], labels.instance[rows][told]
    ranges = np.linalg.norm(frame.points[rows, :2], axis=1)[told]
    for box in labels.boxes:
        own = movable & (owner == box.id)
        if own.any():
            place = int(np.searchsorted(EDGES_M, np.median(ranges[own])))
            tally[box.category, place] += (np.count_nonzero(found[own]), np.count_nonzero(own))
    return compare(found, movable)


def main() -> None:
    """Score, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("weights", type=Path)
    parser.add_argument("--windows", type=int, default=200)
    parser.add_argument("--extent", type=float, default=64.0)
    options = parser.parse_args()
    torch.set_num_threads(1)
    network = load_network(options.weights)
    tally: Tally = defaultdict(lambda: np.zeros(2, dtype=np.int64))
    numbers = tqdm(held_out_numbers(options.windows))
    parts = [score(network, number, options.extent, tally) for number in numbers]
    whole = SegmentationCounts.pool(parts)
    shown = [one.iou for one in parts if one.true_positive + one.false_negative > FEWEST_POINTS]
    print(f"foreground IoU {whole.iou:.3f}, P {whole.precision:.3f}, R {whole.recall:.3f};")
    print(f"mean of {len(shown)} windows {np.mean(shown) if shown else np.nan:.3f}\n")
    rows = []
    for kind in sorted({kind for kind, _ in tally}):
        pairs = [tally[kind, place] for place in range(len(RANGES))]
        rows.append([kind, *(f"{a / b:.2f} of {b}" if b else "-" for a, b in pairs)])
    print(Table("Recall by kind", ["", *RANGES], rows).markdown())


if __name__ == "__main__":
    main()
