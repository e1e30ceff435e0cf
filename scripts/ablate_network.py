"""Scores the network alone with one of its parts left out at a time, beside the paper's table.

Usage: ablate_network.py WEIGHTS [--windows 20] [--extent 64] [--threads 2] [--drive DIR]

On the simulator's test set or a labelled drive; five frames, the first the target, ground included.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import torch
from tqdm import tqdm

from lidaraccum.evaluation.report_tables import Table
from lidaraccum.model.checkpoint import load_network
from lidaraccum.training.ablations import PARTS, score_without
from lidaraccum.training.end_to_end import EndToEnd
from lidaraccum.training.exam import recorded_windows, simulated_windows

TITLES = (
    "left out", "motion R", "P", "WCov", "static background EPE cm", "static foreground EPE cm",
    "dynamic EPE cm", "median", "AccS", "AccR", "ROutl",
)  # fmt: skip
PAPER = {
    "nothing (paper, Waymo)": "92.2 96.8 80.4 2.9 2.1 19.7 6.2 53.3 77.5 5.9",
    "foreground (paper)": "92.7 94.6 82.2 4.1 2.8 28.6 7.1 45.5 71.3 10.8",
    "motion (paper)": "- - 83.0 3.1 19.0 19.8 6.2 53.5 77.4 6.3",
    "offsets (paper)": "92.2 96.5 79.1 2.9 2.1 20.2 6.4 52.5 76.1 6.1",
    "direct poses (paper)": "93.2 94.9 81.9 4.4 3.0 17.1 6.8 48.0 77.0 4.8",
}
"""Its table 4."""


def row(name: str, scores: EndToEnd) -> tuple[str, ...]:
    """A line of the table."""
    motion, flow = scores.motion, scores.flow
    dynamic = flow.dynamic
    shares = (motion.recall, motion.precision, scores.association.weighted_coverage)
    metres = (
        flow.static_background.epe_mean, flow.static_foreground.epe_mean,
        dynamic.epe_mean, dynamic.epe_median,
    )  # fmt: skip
    accuracies = (dynamic.acc_strict, dynamic.acc_relaxed, dynamic.robust_outlier)
    return (name, *(f"{100 * number:.1f}" for number in (*shares, *metres, *accuracies)))


def main() -> None:
    """Parse, score, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("weights", type=Path)
    parser.add_argument("--windows", type=int, default=20)
    parser.add_argument("--extent", type=float, default=64.0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--drive", type=Path)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    network = load_network(options.weights)
    what = (options.windows, options.extent, network.settings)
    batches = recorded_windows(options.drive, *what) if options.drive else simulated_windows(*what)
    with torch.no_grad():
        scored = [score_without(network, one) for one in tqdm(batches, total=options.windows)]
    pooled = {part: EndToEnd.pool(one[part] for one in scored) for part in PARTS}
    rows = [row(part, scores) for part, scores in pooled.items()]
    theirs = [(name, *numbers.split()) for name, numbers in PAPER.items()]
    print(Table(f"{len(scored)} windows", TITLES, [*rows, *theirs]).markdown())


if __name__ == "__main__":
    main()
