"""The mean of weights is their mean, and of one network only."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess

import pytest
import torch

from lidaraccum.model.checkpoint import load_network, save_network
from lidaraccum.model.network import build_network
from lidaraccum.model.settings import NetworkSettings

SCRIPT = Path(__file__).parents[2] / "scripts" / "average_weights.py"
SMALL = NetworkSettings(extent_m=16.0, base_widths=(8, 8), motion_widths=(8, 8), ego_channels=8)


def average(*names: Path, output: Path, more: tuple[str, ...] = ()) -> CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), *map(str, names), "-o", str(output), *more]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    paths = [tmp_path / f"{seed}.safetensors" for seed in range(3)]
    for seed, path in enumerate(paths):
        save_network(build_network(SMALL, seed), path)
    return paths


def test_every_weight_is_the_mean(files: list[Path], tmp_path: Path) -> None:
    done = average(*files, output=tmp_path / "mean.safetensors")
    assert done.returncode == 0, done.stderr
    mean = load_network(tmp_path / "mean.safetensors")
    parts = [dict(load_network(path).named_parameters()) for path in files]
    for name, values in mean.named_parameters():
        expected = (parts[0][name] + parts[1][name] + parts[2][name]) / 3
        torch.testing.assert_close(values, expected)


@pytest.mark.parametrize(("more", "count"), [((), 5), (("--ego-pillars", "9"), 9)])
def test_it_matches_as_many_pillars_as_the_first_or_as_it_is_told(
    files: list[Path], tmp_path: Path, more: tuple[str, ...], count: int
) -> None:
    """How many are matched is no matter of the weights: training takes fewer, for its time."""
    save_network(build_network(replace(SMALL, ego_pillars=5)), files[0])
    done = average(*files, output=tmp_path / "mean.safetensors", more=more)
    assert done.returncode == 0, done.stderr
    assert load_network(tmp_path / "mean.safetensors").settings.ego_pillars == count


def test_it_may_have_the_tube_net_of_others(files: list[Path], tmp_path: Path) -> None:
    """Of another kind than those of the weights that are averaged."""
    old = tmp_path / "old.safetensors"
    save_network(build_network(replace(SMALL, tube="sides"), 5), old)
    mean = tmp_path / "mean.safetensors"
    assert average(files[0], old, output=mean).returncode != 0
    done = average(files[0], old, output=mean, more=("--tubes", str(files[1])))
    assert done.returncode == 0, done.stderr
    got, tubes, one, two = (
        dict(load_network(path).named_parameters()) for path in (mean, files[1], files[0], old)
    )
    assert got.keys() == tubes.keys()
    for name, values in got.items():
        own = name.startswith("tube_net.")
        torch.testing.assert_close(values, tubes[name] if own else (one[name] + two[name]) / 2)


def test_other_networks_are_refused(files: list[Path], tmp_path: Path) -> None:
    save_network(build_network(replace(SMALL, pillar_points=3)), files[0])
    done = average(*files, output=tmp_path / "mean.safetensors")
    assert done.returncode != 0
    assert "settings" in done.stderr
    assert not (tmp_path / "mean.safetensors").exists()
