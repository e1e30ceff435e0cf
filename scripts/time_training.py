"""What a training window costs, stage by stage. Usage: time_training.py [RECIPE.toml].

CPU seconds of one thread, medians; windows are cut from a few drives that are made for this.
"""

from __future__ import annotations

import sys
import tempfile
import time
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from statistics import median

import torch

from lidaraccum.cli.options import read_toml
from lidaraccum.cli.tables import settings_from
from lidaraccum.model.network import Network, build_network
from lidaraccum.model.precision import has_bfloat16, inference
from lidaraccum.training.dataset import SimulatedDrives
from lidaraccum.training.kept import KeptDrives
from lidaraccum.training.objective import objective
from lidaraccum.training.optimiser import Optimiser
from lidaraccum.training.settings import TrainSettings
from lidaraccum.training.window import TrainingWindow, make_batch

RECIPE = Path(__file__).parent / "recipe.toml"
DRIVES, WINDOWS = 6, 12


def main() -> None:
    """Cut, learn, print."""
    torch.set_num_threads(1)
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else RECIPE
    settings = settings_from(TrainSettings, {**read_toml(path)["train"], "steps": 1}, "train")
    network = build_network(settings.network, settings.seed).train()
    print("| | s a window | windows a second |\n|---|---|---|")
    windows = cut(settings, network)
    learn(settings, network, windows, "float32", nullcontext())
    if has_bfloat16("cpu"):
        learn(settings, network, windows, "bfloat16", inference())
    for muon in (False, True):
        optimiser = Optimiser(network, 1e-6, muon=muon)
        spent = []
        for _ in range(4):
            start = time.process_time()
            optimiser.step(1e-6)
            spent.append(time.process_time() - start)
        show("Muon" if muon else "Adam", median(spent) / settings.optimiser.batch)


def cut(settings: TrainSettings, network: Network) -> list[TrainingWindow]:
    """Windows of drives that are simulated and stored first."""
    how = settings.windows
    make = SimulatedDrives(network.settings, how, settings.seed).make
    with tempfile.TemporaryDirectory() as folder:
        kept = KeptDrives(Path(folder), make, DRIVES, network.settings, how, settings.seed)
        simulating, cutting = [], []
        for number in range(DRIVES):
            start = time.process_time()
            kept.stored(number)
            simulating.append(time.process_time() - start)
        windows = []
        for number in range(WINDOWS):
            start = time.process_time()
            windows += kept.windows(number)
            cutting.append((time.process_time() - start) / how.windows_per_drive)
    show(f"a drive of {how.drive_frames} frames, made once", median(simulating))
    show("cut", median(cutting))
    return windows


def learn(
    settings: TrainSettings,
    network: Network,
    windows: list[TrainingWindow],
    precision: str,
    context: AbstractContextManager[object],
) -> None:
    """Forward and backward, the first batch beforehand: some is paid only once."""
    size = settings.optimiser.batch
    forward, backward = [], []
    for first in (0, *range(0, len(windows) - size + 1, size)):
        generator = torch.Generator().manual_seed(first)
        start = time.process_time()
        with context:
            batch = make_batch(windows[first : first + size])
            losses = objective(network, batch, settings.objective, generator)
        middle = time.process_time()
        network.zero_grad(set_to_none=True)
        losses.total.backward()  # type: ignore[no-untyped-call]
        forward.append((middle - start) / size)
        backward.append((time.process_time() - middle) / size)
    show(f"forward, {precision}", median(forward[1:]))
    show(f"backward, {precision}", median(backward[1:]))


def show(name: str, seconds: float) -> None:
    """A line of the table."""
    print(f"| {name} | {seconds:.3f} | {1 / seconds:.2f} |", flush=True)


if __name__ == "__main__":
    main()
