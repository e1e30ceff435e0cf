"""Scores weights on the simulator's test set or a labelled drive, the network doing it all itself.

Usage: score_weights.py WEIGHTS [--windows 40] [--extent 64] [--threads 2]
                        [--drive DIR [--classed]] [--lift 0.0] [--turn 0] [--dense 0]
                        [--beside 0]

Prints two Markdown tables: the whole network beside the paper's figures (its own poses, masks,
objects and motions; five frames, the first the target, ground included, sweeps compensated), and
each stage given the truth of those before it.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, replace
from pathlib import Path

import torch
from tqdm import tqdm

from lidaraccum.evaluation import paper
from lidaraccum.evaluation.report_tables import Table
from lidaraccum.evaluation.scores import Scores as EvaluationScores
from lidaraccum.evaluation.table import Row, row_of
from lidaraccum.metrics.segmentation import SegmentationCounts
from lidaraccum.model.checkpoint import load_network
from lidaraccum.training.end_to_end import EndToEnd
from lidaraccum.training.exam import recorded_windows, simulated_windows
from lidaraccum.training.scores import scores_of
from lidaraccum.training.stages import StageScores, score_stages
from lidaraccum.training.window import Batch

STAGES = (
    "foreground_iou", "foreground_precision", "foreground_recall", "motion_iou",
    "motion_precision", "motion_recall", "ego_epe_m", "ego_epe_median_m", "offset_m",
    "object_epe_m", "object_still_m",
)  # fmt: skip


def whole_row(name: str, parts: list[StageScores]) -> Row:
    """The line of the network alone."""
    alone = EndToEnd.pool(part.alone for part in parts)
    scores = EvaluationScores(
        windows=len(parts),
        flow=alone.flow,
        motion=alone.motion,
        foreground=SegmentationCounts.pool(part.foreground for part in parts),
        association=alone.association,
        moving_association=alone.moving,
    )
    return replace(row_of(name, scores), seconds=float("nan"))


def lifted(batch: Batch, metres: float) -> Batch:
    """The batch as it would be were the ground found so much too low."""
    return replace(batch, frames=replace(batch.frames, height=batch.frames.height + metres))


def main() -> None:
    """Parse, score, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("weights", type=Path)
    parser.add_argument("--windows", type=int, default=40)
    parser.add_argument("--extent", type=float, default=64.0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--drive", type=Path)
    parser.add_argument("--classed", action="store_true", help="leave out points of no class")
    parser.add_argument("--lift", type=float, default=0.0, help="tell heights so much too high, m")
    parser.add_argument("--turn", type=float, default=0.0, help="turn all frames, degrees")
    parser.add_argument("--dense", type=float, default=0.0, help="share of plants closed outside")
    parser.add_argument("--beside", type=float, default=0.0, help="large things every 20 m")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    network = load_network(options.weights)
    what = (options.windows, options.extent, network.settings)
    batches = (
        recorded_windows(options.drive, *what, classed=options.classed, yaw_deg=options.turn)
        if options.drive
        else simulated_windows(
            *what, yaw_deg=options.turn, dense=options.dense, beside=options.beside
        )
    )
    batches = (lifted(batch, options.lift) for batch in batches)
    began = time.monotonic()
    with torch.no_grad():
        parts = [score_stages(network, batch) for batch in tqdm(batches, total=options.windows)]
    print(f"{len(parts)} windows, {options.extent:g} m grid, {time.monotonic() - began:.0f} s\n")
    rows = [whole_row("network alone", parts).cells(), paper.WAYMO.cells()]
    print(Table("The network alone", Row.titles(), rows).markdown(), end="\n\n")
    stages = asdict(scores_of(parts))
    cells = [f"{stages[name]:.3f}" for name in STAGES]
    heading = "Each stage given the truth of those before it"
    print(Table(heading, STAGES, [cells]).markdown())


if __name__ == "__main__":
    main()
