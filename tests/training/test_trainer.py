"""A run can be stopped, killed and resumed, and is the same run."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest
import torch

from lidaraccum.errors import OutputExistsError, SettingsError
from lidaraccum.model.checkpoint import load_network, read_tensors
from lidaraccum.model.network import build_network
from lidaraccum.training.settings import OptimiserSettings, TrainSettings
from lidaraccum.training.state import METRICS_FILE, STATE_FILE, WEIGHTS_FILE
from lidaraccum.training.trainer import clip_gradients, learning_rate, train


def settings_of(toy: ModuleType, steps: int) -> TrainSettings:
    return TrainSettings(
        network=toy.SMALL, windows=toy.WINDOWS, steps=steps, workers=0, threads=1,
        validate_steps=0, log_steps=1, device="cpu",
    )  # fmt: skip


def curve(folder: Path) -> list[float]:
    lines = (folder / METRICS_FILE).read_text().splitlines()
    return [entry["total"] for entry in map(json.loads, lines) if entry["kind"] == "loss"]


@pytest.mark.slow
def test_six_steps_are_three_steps_and_three_resumed(toy: ModuleType, tmp_path: Path) -> None:
    source = toy.CarParks()
    train(settings_of(toy, 6), tmp_path / "whole", source=source)
    train(settings_of(toy, 3), tmp_path / "parts", source=source)
    report = train(settings_of(toy, 6), tmp_path / "parts", source=source, resume=True)
    assert report.steps == 6
    assert curve(tmp_path / "parts") == pytest.approx(curve(tmp_path / "whole"), rel=1e-3)
    whole, _ = read_tensors(tmp_path / "whole" / WEIGHTS_FILE)
    parts, _ = read_tensors(tmp_path / "parts" / WEIGHTS_FILE)
    for name, tensor in whole.items():
        torch.testing.assert_close(parts[name], tensor, atol=2e-4, rtol=0)


def is_alive_for(seconds: float, process: str) -> bool:
    """Whether a process still runs after so long; one that nobody has buried yet does not."""
    status = Path(f"/proc/{process}/status")
    deadline = time.monotonic() + seconds
    while status.exists() and "State:\tZ" not in status.read_text():
        if time.monotonic() > deadline:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 1])
def test_a_killed_run_leaves_whole_files_and_goes_on(
    toy: ModuleType, tmp_path: Path, workers: int
) -> None:
    script = Path(__file__).with_name("endless.py")
    run = subprocess.Popen([sys.executable, str(script), str(tmp_path), str(workers)])
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and run.poll() is None:
        if (tmp_path / METRICS_FILE).exists() and len(curve(tmp_path)) >= 3:
            break
        time.sleep(0.05)
    children = Path(f"/proc/{run.pid}/task/{run.pid}/children")
    started = children.read_text().split() if children.exists() else []
    run.kill()
    run.wait()
    assert not any(is_alive_for(10.0, child) for child in started)
    _, metadata = read_tensors(tmp_path / STATE_FILE)
    done = int(metadata["step"])
    assert done >= 2
    load_network(tmp_path / WEIGHTS_FILE)
    settings = settings_of(toy, done + 1)
    report = train(settings, tmp_path, source=toy.CarParks(), resume=True)
    assert report.steps == done + 1
    assert len(curve(tmp_path)) == done + 1


def test_a_run_is_not_overwritten_nor_resumed_as_another(toy: ModuleType, tmp_path: Path) -> None:
    settings = settings_of(toy, 1)
    train(settings, tmp_path, source=toy.CarParks())
    with pytest.raises(OutputExistsError):
        train(settings, tmp_path, source=toy.CarParks())
    with pytest.raises(SettingsError, match="other settings"):
        train(replace(settings, seed=9), tmp_path, source=toy.CarParks(), resume=True)


def test_validation_scores_the_running_mean(toy: ModuleType, tmp_path: Path) -> None:
    settings = replace(settings_of(toy, 1), validate_steps=1, validation_windows=1)
    report = train(settings, tmp_path, source=toy.CarParks(), held_out=toy.CarParks())
    assert report.scores is not None
    assert report.scores.windows == 2
    assert report.scores.ego_epe_m >= 0
    assert report.scores.object_still_m > 0.05
    kinds = [
        json.loads(line)["kind"] for line in (tmp_path / METRICS_FILE).read_text().splitlines()
    ]
    assert kinds == ["loss", "score"]


def test_fine_tuning_starts_from_the_weights_given(toy: ModuleType, tmp_path: Path) -> None:
    train(settings_of(toy, 1), tmp_path / "first", source=toy.CarParks())
    start = tmp_path / "first" / WEIGHTS_FILE
    optimiser = OptimiserSettings(rate=0.0)
    settings = replace(settings_of(toy, 1), start_from=start, optimiser=optimiser)
    deeper = (*settings.network.base_widths, 40)
    settings = replace(
        settings, network=replace(settings.network, pillar_points=3, base_widths=deeper)
    )
    train(settings, tmp_path / "second", source=toy.CarParks())
    begun = load_network(tmp_path / "second" / WEIGHTS_FILE).settings
    assert (begun.pillar_points, begun.base_widths) == (3, deeper)
    before, _ = read_tensors(start)
    after, _ = read_tensors(tmp_path / "second" / WEIGHTS_FILE)
    assert len(after) > len(before)
    for name, tensor in before.items():
        lower = name.replace("ups.1", "ups.2").replace("ups.0", "ups.1")
        place = lower if name.startswith("backbone") else name
        torch.testing.assert_close(after[place], tensor)


def test_the_rate_rises_then_falls() -> None:
    settings = OptimiserSettings(rate=1.0, warmup_steps=10, epoch_steps=100)
    rates = [learning_rate(settings, step, 0.0) for step in (0, 9, 100, 200)]
    assert rates == pytest.approx([0.1, 0.98**0.09, 0.98, 0.98**2])
    cosine = replace(settings, schedule="cosine")
    ends = [learning_rate(cosine, step, step / 1000) for step in (10, 500, 1000)]
    assert ends == pytest.approx([1.0, 0.505, 0.01], abs=1e-3)


def test_each_part_learns_although_another_shouts(toy: ModuleType, tmp_path: Path) -> None:
    """The longest gradient of all must not decide how far every other part of it goes."""
    network = build_network(toy.SMALL)
    for name, parameter in network.named_parameters():
        parameter.grad = torch.full_like(parameter, 1e6 if name.startswith("tube_net") else 1e-3)
    before = network.backbone.stem.weight.grad.clone()
    assert clip_gradients(network, 5.0)
    torch.testing.assert_close(network.backbone.stem.weight.grad, before)
    assert torch.linalg.vector_norm(network.tube_net.last.weight.grad) <= 5.0
    network.tube_net.last.bias.grad[0] = torch.nan
    assert not clip_gradients(network, 5.0)


def test_training_needs_an_end() -> None:
    with pytest.raises(SettingsError, match="end"):
        TrainSettings()
