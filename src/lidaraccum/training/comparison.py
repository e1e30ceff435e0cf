"""Recipes compared: each trained with each seed on one budget, in a folder of its own, and scored.

What is done stays done: killed and started again, a comparison goes on where it was.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import torch

from lidaraccum.errors import SettingsError
from lidaraccum.io.atomic import write_json, write_text
from lidaraccum.model.checkpoint import load_network
from lidaraccum.training.curves import read_curves
from lidaraccum.training.cutting import WindowSettings
from lidaraccum.training.dataset import SimulatedDrives
from lidaraccum.training.exam import Marks, examine
from lidaraccum.training.kept import KeptDrives
from lidaraccum.training.loader import store_all
from lidaraccum.training.recipes import PlanSettings, Recipe, check_plan
from lidaraccum.training.scores import Scores
from lidaraccum.training.state import METRICS_FILE
from lidaraccum.training.trainer import TrainReport, fresh_network, train
from lidaraccum.training.watch import Watch

SETTINGS_FILE = "settings.json"
RESULT_FILE = "result.json"
DRIVES_SEED = 0
"""Of the drives that are kept; the run's own decides how they are cut, and in which order."""
FINAL_SHARE = 0.2
"""Of a run's steps: what its final losses are the means of."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class MeanLosses:
    """Of the end of a run; NaN where nothing was learned."""

    ego: float
    foreground: float
    motion: float
    offset: float
    objects: float


@dataclass(frozen=True)
class RunResult:
    """What one run came to.

    Attributes:
        recipe: Its name.
        seed: The run's.
        windows: Learned.
        seconds: Spent on them.
        losses: At the end.
        marks: Of the running mean of the weights.
    """

    recipe: str
    seed: int
    windows: int
    seconds: float
    losses: MeanLosses
    marks: Marks


def compare(
    plan: PlanSettings, recipes: Sequence[Recipe], folder: Path, watch: Watch | None = None
) -> Iterator[RunResult]:
    """Run what is not done yet, one run after another, all recipes with the first seed first.

    Args:
        plan: What all have alike.
        recipes: Of different names.
        folder: Each run has ``NAME/seed-SEED`` in it.
        watch: Told how each run goes; may end them all, to be gone on with another time.

    Raises:
        SettingsError: Two recipes share a name, there is no folder for kept drives, or a run in
            the folder was made with other settings.
    """
    watch = watch or Watch()
    check_plan(plan, recipes)
    runs = [_Run(plan, recipe, seed, folder) for seed in plan.seeds for recipe in recipes]
    for run in runs:
        run.check_folder()
    threads = torch.get_num_threads()
    for run in runs:
        torch.set_num_threads(threads)  # the run before may have left another number
        result = run.result() or run.go(watch)
        if result is None:
            return
        yield result


class _Run:
    """A recipe with a seed, done or not."""

    def __init__(self, plan: PlanSettings, recipe: Recipe, seed: int, folder: Path) -> None:
        self.plan = plan
        self.recipe = recipe
        self.seed = seed
        self.folder = folder / recipe.name / f"seed-{seed}"
        self.settings = plan.settings_for(recipe, seed)

    def check_folder(self) -> None:
        """Refuse a folder in which something else was run."""
        noted = self.folder / SETTINGS_FILE
        if noted.exists() and noted.read_text() != _plain(self.settings):
            raise SettingsError(
                f"{self.folder} was run with other settings, or another budget",
                hint="give the recipe another name, or the comparison another folder",
            )

    def result(self) -> RunResult | None:
        """What is stored of it; None if it is not done, or scored on something else."""
        path = self.folder / RESULT_FILE
        stored = json.loads(path.read_text()) if path.is_file() else {}
        if stored.get("exam") != json.loads(_plain(self.plan.exam)):
            return None
        marks = stored["marks"]
        recorded = {name: _read(Scores, scores) for name, scores in marks["recorded"].items()}
        return RunResult(
            recipe=self.recipe.name,
            seed=self.seed,
            windows=stored["windows"],
            seconds=stored["seconds"],
            losses=_read(MeanLosses, stored["losses"]),
            marks=Marks(_read(Scores, marks["simulated"]), recorded),
        )

    def go(self, watch: Watch) -> RunResult | None:
        """Train, go on training, or only score; None if it was ended before it was done."""
        write_text(self.folder / SETTINGS_FILE, _plain(self.settings), overwrite=True)
        report = self._train(watch)
        if report is None:
            return None
        marks = examine(load_network(report.weights), self.plan.exam, watch.wants_end)
        if marks is None:
            return None
        result = RunResult(
            recipe=self.recipe.name,
            seed=self.seed,
            windows=report.steps * self.settings.optimiser.batch,
            seconds=report.seconds,
            losses=final_losses(self.folder / METRICS_FILE),
            marks=marks,
        )
        stored = asdict(result) | {"exam": json.loads(_plain(self.plan.exam))}
        write_json(self.folder / RESULT_FILE, stored, overwrite=True)
        return result

    def _train(self, watch: Watch) -> TrainReport | None:
        drives = self._kept_drives()
        if drives is not None and not _made(drives, self.settings.workers, watch.wants_end):
            return None
        report = train(self.settings, self.folder, resume=True, source=drives, watch=watch)
        return None if watch.wants_end() else report

    def _kept_drives(self) -> KeptDrives | None:
        settings, shared = self.settings, self.plan.drives
        if not settings.keep_drives or shared is None:
            return None
        network, windows = fresh_network(settings).settings, settings.windows
        make = SimulatedDrives(network, windows, DRIVES_SEED).make
        folder = shared / _kind_of_drives(windows)
        folder.mkdir(parents=True, exist_ok=True)
        return KeptDrives(folder, make, settings.keep_drives, network, windows, settings.seed)


def _kind_of_drives(windows: WindowSettings) -> str:
    """A folder's name: one for each choice of what decides how drives are made."""
    shutter = {None: "", True: "rolling", False: "at-once"}[windows.rolling_shutter]
    words = [
        f"rare{windows.rare:g}" if windows.rare != 1.0 else "",
        f"green{windows.green:g}" if windows.green != 1.0 else "",
        f"dense{windows.dense:g}" if windows.dense else "",
        f"beside{windows.beside:g}" if windows.beside else "",
        f"bias{windows.beam_bias:g}" if windows.beam_bias != 1.0 else "",
        "" if windows.furniture else "bare",
        shutter,
        "exact" if windows.exact else "",
        *windows.sensors,
    ]
    parts = [f"{windows.extent_m:g}m", f"{windows.drive_frames}frames", *filter(None, words)]
    return "-".join(parts)


def _made(drives: KeptDrives, workers: int, wants_end: Callable[[], bool]) -> bool:
    """Make drives before the clock runs, so that no run pays for another's; whether all are."""
    missing = len(drives.missing())
    if missing:
        _log.info("making %d drives in %s", missing, drives.folder)
    return all(not wants_end() for _ in store_all(drives, workers))


def final_losses(metrics: Path) -> MeanLosses:
    """Mean of the journal's lines of a run's last fifth of steps."""
    names = [one.name for one in fields(MeanLosses)]
    means = dict.fromkeys(names, math.nan)
    for curve in read_curves(metrics, "loss", names):
        after = (1.0 - FINAL_SHARE) * curve.steps[-1]
        lines = zip(curve.steps, curve.values, strict=True)
        last = [value for step, value in lines if step > after]
        means[curve.name] = sum(last) / len(last)
    return MeanLosses(**means)


def _plain(settings: Any) -> str:
    """Settings as JSON, paths as texts."""
    return json.dumps(asdict(settings), default=str, indent=2) + "\n"


def _read(kind: type[Any], numbers: dict[str, float | None]) -> Any:
    """A dataclass of numbers as `write_json` wrote it, null for NaN."""
    return kind(**{name: math.nan if one is None else one for name, one in numbers.items()})
