"""What a training run is made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from lidaraccum.errors import SettingsError
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.training.dataset import WindowSettings
from lidaraccum.training.objective import ObjectiveSettings


@dataclass(frozen=True)
class OptimiserSettings:
    """The optimiser and its schedule.

    Attributes:
        rate: Learning rate at the start.
        schedule: ``exponential``: times ``decay`` every ``epoch_steps``; ``cosine``: down to a
            hundredth at the end of the run, by steps where they are given, else by the clock (and
            then no two runs are quite alike).
        decay: Of an epoch.
        epoch_steps: Steps that count as an epoch; simulation has no end.
        warmup_steps: Over which the rate rises from nothing.
        clip: Longest gradient of each part of the network by itself: TubeNet's is many times longer
            than the others' and would drown them.
        muon: Muon for the layers' matrices, Adam for the rest only (see `training.optimiser`).
        average: Share of the old in the running mean of the weights, which is what is kept.
        batch: Windows a step.
    """

    rate: float = 5e-4
    schedule: Literal["exponential", "cosine"] = "exponential"
    decay: float = 0.98
    epoch_steps: int = 1000
    warmup_steps: int = 50
    clip: float = 5.0
    muon: bool = False
    average: float = 0.999
    batch: int = 2

    def __post_init__(self) -> None:
        if self.schedule not in ("exponential", "cosine"):
            raise SettingsError(f"the schedule is exponential or cosine, not {self.schedule!r}")
        if self.batch < 1 or self.epoch_steps < 1:
            raise SettingsError("batch and epoch_steps are at least 1")


@dataclass(frozen=True)
class TrainSettings:
    """A run: what is learned, from what, for how long. The same settings, the same weights.

    Attributes:
        network: The network's; when ``start_from`` is given, of it only `model.settings.EFFORT` and
            levels below those of the weights, and the kind of TubeNet (see `model.deepen`).
        windows: How windows are cut and changed.
        objective: What the loss is made of.
        optimiser: The optimiser and its schedule.
        seed: Of the weights, the drives and everything drawn.
        keep_drives: So many simulated drives are made once, stored in the run's folder (some 15 MB
            each) and cut anew again and again; 0 simulates a new one each time.
        steps: Stop after so many.
        hours: Stop after so long, counted over all resumptions; whichever comes first.
        start_from: Weights to go on from (fine-tuning), a checkpoint of the package.
        workers: Processes that make windows; 0 makes them in the trainer's own.
        processes: Processes that learn, each a share of the batch with one thread; on a CPU, as
            many as there are cores is fastest, with as large a batch or a multiple of it.
        threads: CPU threads of the trainer; 0 leaves torch's choice.
        device: ``auto``, ``cpu`` or ``cuda``.
        checkpoint_minutes: Time between checkpoints: what a kill loses at most.
        validate_steps: Steps between validations; 0 for none.
        validation_windows: Held-out windows to validate on.
        log_steps: Steps of which one line of metrics is the mean.
    """

    network: NetworkSettings = field(default_factory=NetworkSettings)
    windows: WindowSettings = field(default_factory=WindowSettings)
    objective: ObjectiveSettings = field(default_factory=ObjectiveSettings)
    optimiser: OptimiserSettings = field(default_factory=OptimiserSettings)
    seed: int = 0
    keep_drives: int = 0
    steps: int | None = None
    hours: float | None = None
    start_from: Path | None = None
    workers: int = 1
    processes: int = 1
    threads: int = 0
    device: Literal["auto", "cpu", "cuda"] = "auto"
    checkpoint_minutes: float = 5.0
    validate_steps: int = 1000
    validation_windows: int = 16
    log_steps: int = 20

    def __post_init__(self) -> None:
        if self.steps is None and self.hours is None:
            raise SettingsError("training needs an end", hint="give steps or hours")
        if self.device not in ("auto", "cpu", "cuda"):
            raise SettingsError(f"the device is auto, cpu or cuda, not {self.device!r}")
        if self.processes < 1 or (self.processes > 1 and self.device == "cuda"):
            raise SettingsError("processes is at least 1, and 1 on an accelerator")
        if min(self.workers, self.checkpoint_minutes, self.keep_drives) < 0 or self.log_steps < 1:
            raise SettingsError(
                "workers, checkpoint_minutes, keep_drives and log_steps cannot be negative"
            )
