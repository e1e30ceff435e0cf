"""Recipes run one after another, each in its folder, as far as they are let."""

from __future__ import annotations

import json
from dataclasses import replace
from math import isnan
from pathlib import Path
from types import ModuleType

import pytest

from lidaraccum.training import comparison
from lidaraccum.training.comparison import compare, final_losses
from lidaraccum.training.cutting import WindowSettings
from lidaraccum.training.exam import ExamSettings
from lidaraccum.training.recipes import PlanSettings, Recipe
from lidaraccum.training.settings import TrainSettings
from lidaraccum.training.watch import Watch


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch, toy: ModuleType) -> list[int]:
    """Numbers of the drives that are made, car parks all of them."""
    numbers: list[int] = []

    class CarParks:
        def __init__(self, network: object, settings: WindowSettings, seed: int) -> None:
            self.frames = settings.drive_frames

        def make(self, number: int) -> object:
            numbers.append(number)
            return toy.CarPark(number, self.frames)

    monkeypatch.setattr(comparison, "SimulatedDrives", CarParks)
    return numbers


def recipes(toy: ModuleType) -> list[Recipe]:
    settings = TrainSettings(
        network=toy.SMALL, windows=toy.WINDOWS, keep_drives=2, steps=1, workers=0, threads=1,
        validate_steps=0, log_steps=1, device="cpu",
    )  # fmt: skip
    detached = replace(settings.objective, detach_motion=True)
    return [Recipe("base", settings), Recipe("detached", replace(settings, objective=detached))]


def steps(run: Path) -> list[int]:
    return [json.loads(line)["step"] for line in (run / "metrics.jsonl").read_text().splitlines()]


@pytest.mark.slow
def test_what_was_ended_is_gone_on_with(toy: ModuleType, made: list[int], tmp_path: Path) -> None:
    plan = PlanSettings((0, 1), windows=5, drives=tmp_path / "kept", exam=ExamSettings(windows=0))
    out = tmp_path / "out"
    seen: list[int] = []
    watch = Watch(on_step=lambda step, _: seen.append(step), wants_end=lambda: len(seen) >= 4)
    results = list(compare(plan, recipes(toy), out, watch))
    assert [(run.recipe, run.seed) for run in results] == [("base", 0)]
    assert steps(out / "detached" / "seed-0") == [1]
    results = list(compare(plan, recipes(toy), out))
    order = [("base", 0), ("detached", 0), ("base", 1), ("detached", 1)]
    assert [(run.recipe, run.seed) for run in results] == order
    for run in results:
        assert run.windows == 6  # whole steps of two windows
        assert steps(out / run.recipe / f"seed-{run.seed}") == [1, 2, 3]
    assert made == [0, 1]
    again = list(compare(plan, recipes(toy), out))
    assert repr(again) == repr(results)  # equal but for NaN, which equals nothing


def test_final_losses_are_those_of_the_last_fifth(tmp_path: Path) -> None:
    metrics = tmp_path / "metrics.jsonl"
    assert isnan(final_losses(metrics).ego)
    lines = [{"kind": "loss", "step": 20 * n, "ego": n, "motion": 2 * n} for n in range(1, 11)]
    lines.append({"kind": "score", "step": 200, "ego": 100})
    metrics.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    losses = final_losses(metrics)
    assert (losses.ego, losses.motion) == (9.5, 19.0)
    assert isnan(losses.offset)
