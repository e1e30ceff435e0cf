"""Where a run stands, in one file: weights, their mean, what the optimiser remembers, the clock."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from lidaraccum.errors import SettingsError
from lidaraccum.model.checkpoint import read_tensors, save_network, write_tensors
from lidaraccum.model.network import Network
from lidaraccum.training.optimiser import Optimiser
from lidaraccum.training.settings import TrainSettings

STATE_FILE = "state.safetensors"
WEIGHTS_FILE = "weights.safetensors"
METRICS_FILE = "metrics.jsonl"

_BUDGET = {
    "steps", "hours", "workers", "threads", "device", "checkpoint_minutes", "validate_steps",
    "validation_windows", "log_steps",
}  # fmt: skip


@dataclass
class RunState:
    """What changes while a run goes on.

    Attributes:
        network: Learns.
        average: A network with the running mean of its weights: what is kept.
        optimiser: Changes it.
        step: Steps done.
        seconds: Time spent, over all resumptions.
    """

    network: Network
    average: Network
    optimiser: Optimiser
    step: int = 0
    seconds: float = 0.0


def fingerprint(settings: TrainSettings) -> str:
    """Of all settings that change what is learned; budgets and cadences may differ."""
    kept = {name: value for name, value in asdict(settings).items() if name not in _BUDGET}
    if settings.optimiser.schedule == "cosine":
        kept["steps"] = settings.steps
    return hashlib.sha256(json.dumps(kept, sort_keys=True, default=str).encode()).hexdigest()


def save_state(state: RunState, settings: TrainSettings, folder: Path) -> None:
    """Write the state, then the weights; a kill at any moment leaves each whole."""
    tensors: dict[str, torch.Tensor] = {}
    for prefix, module in (("network", state.network), ("average", state.average)):
        tensors |= {f"{prefix}.{name}": value for name, value in module.state_dict().items()}
    tensors |= state.optimiser.memory()
    metadata = {
        "step": str(state.step),
        "seconds": repr(state.seconds),
        "fingerprint": fingerprint(settings),
    }
    write_tensors(tensors, metadata, folder / STATE_FILE)
    notes = {"steps": str(state.step), "windows": str(state.step * settings.optimiser.batch)}
    save_network(state.average, folder / WEIGHTS_FILE, notes)


def restore_state(state: RunState, settings: TrainSettings, folder: Path) -> None:
    """Put what a file says into a fresh state.

    Raises:
        SettingsError: The run was started with other settings.
        InputError: The file cannot be read.
    """
    tensors, metadata = read_tensors(folder / STATE_FILE)
    if metadata.get("fingerprint") != fingerprint(settings):
        raise SettingsError(
            f"the run in {folder} was started with other settings",
            hint="resume with the same ones; only budgets and cadences may differ",
        )
    state.network.load_state_dict(_part(tensors, "network"))
    state.average.load_state_dict(_part(tensors, "average"))
    state.step = int(metadata["step"])
    state.seconds = float(metadata["seconds"])
    state.optimiser.recall(tensors, state.step)


def _part(tensors: Mapping[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    start = f"{prefix}."
    return {
        name.removeprefix(start): tensor
        for name, tensor in tensors.items()
        if name.startswith(start)
    }
