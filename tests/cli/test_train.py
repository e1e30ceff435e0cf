"""`lidaraccum train`, through the user's door: begins, is refused, is killed, goes on."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from lidaraccum.model.checkpoint import load_network, read_tensors

STREET = Path(__file__).parents[2] / "examples" / "street"

TINY = """
[train]
workers = 0
threads = 1
validate_steps = 0
checkpoint_minutes = 0.0
log_steps = 1
device = "cpu"

[train.network]
base_widths = [8, 16]
motion_widths = [16, 16]
ego_pillars = 64
temporal_channels = 8
temporal_blocks = 1
point_channels = 16
tube_channels = 16

[train.windows]
extent_m = 16.0
lengths = [2, 3]
windows_per_drive = 2
"""


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


def step_of(folder: Path) -> int:
    return int(read_tensors(folder / "state.safetensors")[1]["step"])


def losses(folder: Path) -> list[dict[str, Any]]:
    lines = (folder / "metrics.jsonl").read_text().splitlines()
    return [entry for entry in map(json.loads, lines) if entry["kind"] == "loss"]


def test_a_labelled_sequence_trains_and_goes_on_from_the_folder_alone(
    run: Any, tiny: Path, tmp_path: Path
) -> None:
    out = tmp_path / "run"
    result = run("train", STREET, "-o", out, "--config", tiny, "--steps", 2, "--batch", 1)
    assert result.exit_code == 0, result.stderr
    assert "2 steps" in result.stderr
    assert load_network(out / "weights.safetensors").settings.base_widths == (8, 16)
    assert (out / "curves.png").read_bytes().startswith(b"\x89PNG")
    refused = run("train", STREET, "-o", out, "--config", tiny, "--steps", 3)
    assert refused.exit_code == 2
    assert "--resume" in refused.stderr
    result = run("train", "-o", out, "--resume", "--steps", 3, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["steps"] == 3
    assert [entry["step"] for entry in losses(out)] == [1, 2, 3]


def test_a_run_is_not_resumed_as_another(run: Any, tiny: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = ("train", STREET, "-o", out, "--config", tiny, "--batch", 1)
    assert run(*words, "--steps", 1).exit_code == 0
    before = (out / "train.toml").read_text()
    result = run("train", "-o", out, "--resume", "--steps", 2, "--seed", 5)
    assert result.exit_code == 2
    assert "other settings" in result.stderr
    assert (out / "train.toml").read_text() == before


def start(out: Path, tiny: Path) -> subprocess.Popen[str]:
    """Train in a process of its own, and wait until two steps are done."""
    words = ["train", STREET, "-o", out, "--config", tiny, "--hours", 1, "--batch", 1]
    command = [sys.executable, "-m", "lidaraccum", *map(str, words)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and process.poll() is None:
        if (out / "metrics.jsonl").exists() and len(losses(out)) >= 2:
            return process
        time.sleep(0.02)
    process.kill()
    raise AssertionError(f"it never began to train: {process.communicate()[1]}")


@pytest.mark.slow
def test_a_killed_run_goes_on(run: Any, tiny: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    process = start(out, tiny)
    process.kill()
    process.communicate(timeout=60)
    done = step_of(out)
    result = run("train", "-o", out, "--resume", "--steps", done + 1)
    assert result.exit_code == 0, result.stderr
    assert step_of(out) == done + 1
    assert [entry["step"] for entry in losses(out)] == list(range(1, done + 2))


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_saves_its_last_step(
    tiny: Path, tmp_path: Path, number: signal.Signals
) -> None:
    out = tmp_path / "run"
    tiny.write_text(TINY.replace("checkpoint_minutes = 0.0", "checkpoint_minutes = 60.0"))
    process = start(out, tiny)
    process.send_signal(number)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stderr
    assert "Traceback" not in stderr
    assert f"Interrupted at step {step_of(out)}" in stderr
    assert losses(out)[-1]["step"] == step_of(out)


def test_all_settings_are_shown_and_can_be_given_back(run: Any, tiny: Path, tmp_path: Path) -> None:
    words = ("train", "-o", tmp_path / "run", "--dry-run")
    shown = run(*words, "--config", tiny, "--hours", 0.5, "--extent", 32)
    assert shown.exit_code == 0, shown.stderr
    assert "extent_m = 32.0" in shown.stdout
    assert not (tmp_path / "run").exists()
    again = tmp_path / "again.toml"
    again.write_text(shown.stdout)
    assert run(*words, "--config", again).stdout == shown.stdout


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("[train]\nstepps = 3\n", "'steps'"),
        ("[train.windows]\nextend_m = 32.0\n", "'extent_m'"),
        ("[train.windows]\nlengths = 5\n", "list"),
        ("[train.optimiser]\nrate = true\n", "number"),
        ("[train.optimiser]\nschedule = 'linear'\n", "cosine"),
        ("[train.windows.augment]\nflip = 3.0\n", "share"),
        ("[train.network]\nextent_m = 17.0\n", "multiple"),
        ("[train]\nnetwork = 3\n", "table"),
        ("[train]\ndata = 3\n", "list"),
        ("train = 3\n", "table"),
        ("[tain]\nsteps = 3\n", "'tain'"),
    ],
)
def test_a_bad_config_is_a_usage_error(run: Any, tmp_path: Path, text: str, word: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    result = run("train", "-o", tmp_path / "run", "--steps", 1, "--config", path)
    assert result.exit_code == 2, result.stderr
    assert word in result.stderr
    assert not (tmp_path / "run").exists()


def test_training_needs_an_end(run: Any, tmp_path: Path) -> None:
    result = run("train", "-o", tmp_path / "run")
    assert result.exit_code == 2
    assert "steps or hours" in result.stderr


def test_data_without_labels_is_unreadable(run: Any, bins: Path, tmp_path: Path) -> None:
    result = run("train", bins, "-o", tmp_path / "run", "--steps", 1)
    assert result.exit_code == 3
    assert "labels" in result.stderr


def test_other_commands_pass_over_the_table(run: Any, tiny: Path) -> None:
    assert run("config", "--config", tiny).exit_code == 0
