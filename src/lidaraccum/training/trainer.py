"""The training loop: from nothing, or from where it was killed, to weights in a folder."""

from __future__ import annotations

import copy
import logging
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from lidaraccum.errors import OutputExistsError, SettingsError
from lidaraccum.model.checkpoint import load_network
from lidaraccum.model.deepen import deepened
from lidaraccum.model.network import Network, build_network
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.training.crew import Crew
from lidaraccum.training.dataset import SimulatedDrives, ValidationDrives, WindowSource
from lidaraccum.training.journal import Journal
from lidaraccum.training.kept import KeptDrives
from lidaraccum.training.loader import batches_from
from lidaraccum.training.objective import LOSS_NAMES
from lidaraccum.training.optimiser import Optimiser
from lidaraccum.training.scores import Scores, score_network
from lidaraccum.training.settings import OptimiserSettings, TrainSettings
from lidaraccum.training.state import (
    METRICS_FILE,
    STATE_FILE,
    WEIGHTS_FILE,
    RunState,
    restore_state,
    save_state,
)
from lidaraccum.training.watch import Watch
from lidaraccum.training.window import Batch, TrainingWindow, make_batch

DRIVES_FOLDER = "drives"
"""Of a run's folder: drives that are kept."""

_SEED_STRIDE = 1_000_003

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class TrainReport:
    """What a run came to.

    Attributes:
        steps: Steps done, all resumptions together.
        seconds: Time spent, likewise.
        weights: The file with the running mean of the weights.
        scores: The last validation's, or None.
    """

    steps: int
    seconds: float
    weights: Path
    scores: Scores | None


def train(
    settings: TrainSettings,
    out_dir: Path,
    *,
    resume: bool = False,
    source: WindowSource | None = None,
    held_out: WindowSource | None = None,
    watch: Watch | None = None,
) -> TrainReport:
    """Train into a folder: ``weights.safetensors``, ``state.safetensors``, ``metrics.jsonl``.

    Args:
        settings: What is learned, from what, for how long.
        out_dir: Made when it is not there.
        resume: Go on from the folder's state, if it has one.
        source: Where windows come from; simulated drives when None.
        held_out: Windows to validate on; seeds that never train, nor test, when None.
        watch: Told how the run goes, and may end it.

    Raises:
        OutputExistsError: The folder holds a run and ``resume`` was not asked for.
        SettingsError: The run to resume was started with other settings, or there is no such
            device.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    if (out_dir / STATE_FILE).exists() and not resume:
        raise OutputExistsError(f"{out_dir} already holds a run", hint="resume it, or name another")
    if settings.threads:
        torch.set_num_threads(settings.threads)
    run = _Run(settings, out_dir, source, held_out, watch or Watch())
    return run.go()


class _Run:
    """One life of a run, from its start or resumption to its end."""

    def __init__(
        self,
        settings: TrainSettings,
        out_dir: Path,
        source: WindowSource | None,
        held_out: WindowSource | None,
        watch: Watch,
    ) -> None:
        self.settings = settings
        self.watch = watch
        self.out_dir = out_dir
        self.device = _pick_device(settings.device)
        self.state = _fresh_state(settings, self.device)
        if (out_dir / STATE_FILE).exists():
            restore_state(self.state, settings, out_dir)
            _log.info("resumed at step %d", self.state.step)
        self.crew = Crew(self.state.network, settings.objective, settings.processes)
        network = self.state.network.settings
        self.source = source or _simulated_source(settings, network, out_dir)
        self.held_out = held_out or ValidationDrives(network, settings.windows.extent_m)
        self.held_out_windows: list[TrainingWindow] = []
        self.journal = Journal(out_dir / METRICS_FILE, self.state.step)
        self.began = time.monotonic() - self.state.seconds
        self.scores: Scores | None = None

    def go(self) -> TrainReport:
        """Train to the end of the budget; the state is on the disk when this returns."""
        settings, state = self.settings, self.state
        saved = time.monotonic()
        recent: list[list[float]] = []
        batches = self._batches()
        while not self._is_over():
            recent.append(self._step(next(batches)))
            self.watch.on_step(state.step, recent[-1][0])
            if state.step % settings.log_steps == 0 or self._is_over():
                self._note_losses(recent)
                recent = []
            if settings.validate_steps and state.step % settings.validate_steps == 0:
                self._validate()
            if time.monotonic() - saved >= 60.0 * settings.checkpoint_minutes:
                self._save()
                saved = time.monotonic()
        self._save()
        return TrainReport(state.step, state.seconds, self.out_dir / WEIGHTS_FILE, self.scores)

    def _batches(self) -> Iterator[list[TrainingWindow]]:
        return batches_from(
            self.source,
            self.state.step,
            self.settings.optimiser.batch,
            self.settings.windows.windows_per_drive,
            self.settings.workers,
        )

    def _spent(self) -> float:
        """Share of the budget used up, 0..1: of steps where they are given, else of time."""
        steps, hours = self.settings.steps, self.settings.hours
        if steps is not None:
            return self.state.step / steps if steps else 1.0
        assert hours is not None, "the settings ask for an end"
        return (time.monotonic() - self.began) / (3600.0 * hours) if hours else 1.0

    def _rate(self) -> float:
        return learning_rate(self.settings.optimiser, self.state.step, self._spent())

    def _is_over(self) -> bool:
        hours = self.settings.hours
        late = hours is not None and time.monotonic() - self.began >= 3600.0 * hours
        return late or self._spent() >= 1.0 or self.watch.wants_end()

    def _step(self, windows: list[TrainingWindow]) -> list[float]:
        state, settings = self.state, self.settings
        losses = self.crew.learn(windows, settings.seed * _SEED_STRIDE + state.step)
        if clip_gradients(state.network, settings.optimiser.clip):
            state.optimiser.step(self._rate())
        else:  # one window must not end a run of days
            _log.warning("step %d: gradient is not finite, nothing learned", state.step)
        state.step += 1
        _follow(state.average, state.network, settings.optimiser.average, state.step)
        return losses

    def _note_losses(self, recent: list[list[float]]) -> None:
        means = [sum(column) / len(recent) for column in zip(*recent, strict=True)]
        numbers = dict(zip(LOSS_NAMES, means, strict=True)) | {"rate": self._rate()}
        self.journal.note("loss", self.state.step, time.monotonic() - self.began, numbers)

    def _validate(self) -> None:
        self.scores = score_network(self.state.average, self._held_out_batches())
        seconds = time.monotonic() - self.began
        self.journal.note("score", self.state.step, seconds, asdict(self.scores))
        self.watch.on_scores(self.state.step, self.scores)

    def _held_out_batches(self) -> Iterator[Batch]:
        if not self.held_out_windows:  # made once: they are the same each time
            places = range(self.settings.validation_windows)
            self.held_out_windows = [w for place in places for w in self.held_out.windows(place)]
        return (make_batch([window], self.device) for window in self.held_out_windows)

    def _save(self) -> None:
        self.state.seconds = time.monotonic() - self.began
        save_state(self.state, self.settings, self.out_dir)


def _simulated_source(
    settings: TrainSettings, network: NetworkSettings, out_dir: Path
) -> WindowSource:
    drives = SimulatedDrives(network, settings.windows, settings.seed)
    if not settings.keep_drives:
        return drives
    folder = out_dir / DRIVES_FOLDER
    folder.mkdir(exist_ok=True)
    return KeptDrives(
        folder, drives.make, settings.keep_drives, network, settings.windows, settings.seed
    )


def _pick_device(name: str) -> torch.device:
    if name == "cuda" and not torch.cuda.is_available():
        raise SettingsError("there is no CUDA device here", hint="use cpu or auto")
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    return torch.device(name)


def fresh_network(settings: TrainSettings) -> Network:
    """What a run begins with: weights drawn by its seed, or those it goes on from."""
    if settings.start_from is None:
        return build_network(settings.network, settings.seed)
    return deepened(load_network(settings.start_from, settings.network), settings.network)


def _fresh_state(settings: TrainSettings, device: torch.device) -> RunState:
    network = fresh_network(settings).to(device).train()
    average = copy.deepcopy(network).eval().requires_grad_(False)
    optimiser = Optimiser(network, settings.optimiser.rate, muon=settings.optimiser.muon)
    return RunState(network, average, optimiser)


def learning_rate(settings: OptimiserSettings, step: int, spent: float) -> float:
    """Rate of step ``step`` (from 0), when the share ``spent`` (0..1) of the budget is used up."""
    rise = min(1.0, (step + 1) / settings.warmup_steps) if settings.warmup_steps else 1.0
    if settings.schedule == "cosine":
        fall = 0.505 + 0.495 * math.cos(math.pi * min(spent, 1.0))
    else:
        fall = settings.decay ** (step / settings.epoch_steps)
    return settings.rate * rise * fall


def clip_gradients(network: torch.nn.Module, longest: float) -> bool:
    """Shorten the gradients of each part of the network; whether all are finite."""
    lengths = [
        torch.nn.utils.clip_grad_norm_(part.parameters(), longest) for part in network.children()
    ]
    return bool(torch.isfinite(torch.stack(lengths)).all())


@torch.no_grad()
def _follow(average: torch.nn.Module, network: torch.nn.Module, keep: float, step: int) -> None:
    """Move the running mean; it forgets fast at first, so that early weights do not linger."""
    keep = min(keep, (1.0 + step) / (10.0 + step))
    for mean, value in zip(average.parameters(), network.parameters(), strict=True):
        mean.lerp_(value, 1.0 - keep)
