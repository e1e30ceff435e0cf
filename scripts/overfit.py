"""Learns four simulated windows by heart, on the real loss. Usage: overfit.py MINUTES."""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
import torch

from lidaraccum.model.network import build_network
from lidaraccum.model.precision import inference
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.windows import training_settings
from lidaraccum.training.augment import NO_AUGMENTATION, augment
from lidaraccum.training.clusters import TRUE_CLUSTERS
from lidaraccum.training.objective import ObjectiveSettings, objective
from lidaraccum.training.scores import score_network
from lidaraccum.training.truth import make_window
from lidaraccum.training.window import Batch, make_batch

RATE = 1e-3


def window(seed: int) -> Batch:
    """Five frames of a drive as they are, thinned, on the 32 m grid."""
    drive = simulate(replace(training_settings(seed), compensated=True, sensor="HDL-64E"))
    frames = [(drive[index], drive.labels(index)) for index in range(5)]
    thin = replace(NO_AUGMENTATION, most_points=40_000)
    network = build_network()
    frames = augment(frames, thin, np.random.default_rng(seed))
    return make_batch([make_window(frames, 0, network.settings, 32.0)])


def main() -> None:
    """Train for the time given, print the losses every 50 steps, then the scores."""
    torch.set_num_threads(2)
    seconds = 60.0 * float(sys.argv[1])
    batches = [window(seed) for seed in (1, 2, 5, 8)]
    network = build_network().train()
    optimiser = torch.optim.Adam(network.parameters(), lr=RATE)
    settings = ObjectiveSettings(poses="true", clusters=TRUE_CLUSTERS)
    start, step = time.monotonic(), 0
    while (spent := time.monotonic() - start) < seconds:
        optimiser.param_groups[0]["lr"] = RATE * max(0.02, 1.0 - spent / seconds)
        generator = torch.Generator().manual_seed(step)
        with inference():
            losses = objective(network, batches[step % 4], settings, generator)
        optimiser.zero_grad()
        losses.total.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        step += 1
        if step % 40 == 0:
            print(step, f"{spent:.0f} s", [round(number, 3) for number in losses.numbers()])
    print(step, "steps", score_network(network, batches))


if __name__ == "__main__":
    main()
