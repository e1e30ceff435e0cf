"""Learns four simulated windows by heart, on the real loss.

Usage: overfit.py MINUTES [PROCESSES]

Prints the losses every 20 steps of two windows each, the scores at half time and at the end.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
import torch

from lidaraccum.model.network import build_network
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.windows import training_settings
from lidaraccum.training.augment import NO_AUGMENTATION, augment
from lidaraccum.training.clusters import TRUE_CLUSTERS
from lidaraccum.training.crew import Crew
from lidaraccum.training.objective import ObjectiveSettings
from lidaraccum.training.scores import score_network
from lidaraccum.training.trainer import clip_gradients
from lidaraccum.training.truth import make_window
from lidaraccum.training.window import TrainingWindow, make_batch

RATE = 1e-3
SEEDS = (1, 2, 5, 8)


def window(seed: int) -> TrainingWindow:
    """Five frames of a drive as they are, thinned, on the 32 m grid."""
    drive = simulate(replace(training_settings(seed), compensated=True, sensor="HDL-64E"))
    frames = [(drive[index], drive.labels(index)) for index in range(5)]
    thin = replace(NO_AUGMENTATION, most_points=40_000)
    frames = augment(frames, thin, np.random.default_rng(seed))
    return make_window(frames, 0, NetworkSettings(), 32.0)


def main() -> None:
    """Train for the time given."""
    seconds = 60.0 * float(sys.argv[1])
    processes = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    torch.set_num_threads(1)
    windows = [window(seed) for seed in SEEDS]
    network = build_network().train()
    crew = Crew(network, ObjectiveSettings(poses="true", clusters=TRUE_CLUSTERS), processes)
    optimiser = torch.optim.Adam(network.parameters(), lr=RATE)
    start, step, told = time.monotonic(), 0, False
    while (spent := time.monotonic() - start) < seconds:
        optimiser.param_groups[0]["lr"] = RATE * max(0.02, 1.0 - spent / seconds)
        losses = crew.learn(windows[step % 2 :: 2], step)
        clip_gradients(network, 5.0)
        optimiser.step()
        step += 1
        if step % 20 == 0:
            print(step, f"{spent:.0f} s", [round(number, 3) for number in losses], flush=True)
        if not told and spent > seconds / 2:
            told = True
            print("half time", score_network(network, [make_batch([one]) for one in windows]))
    print(step, "steps", score_network(network, [make_batch([one]) for one in windows]))


if __name__ == "__main__":
    main()
