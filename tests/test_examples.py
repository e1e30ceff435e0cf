"""The shipped example and every script beside it run, and show what they promise."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.accumulation import MOVING
from lidaraccum.io.sequences import open_sequence

EXAMPLES = Path(__file__).parents[1] / "examples"
STREET = EXAMPLES / "street"


@pytest.fixture(scope="module")
def cloud(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The main job on the shipped example, as the README has it."""
    from click.testing import CliRunner

    from lidaraccum.cli.main import cli

    out = tmp_path_factory.mktemp("street") / "street.npz"
    result = CliRunner().invoke(cli, ["accumulate", str(STREET), "-o", str(out)])
    assert result.exit_code == 0, result.stderr
    return out


def check_street(folder: Path) -> None:
    sequence = open_sequence(folder)
    assert len(sequence) == 10
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    assert size < 5_000_000
    assert "MIT" in json.loads((folder / "meta.json").read_text())["licence"]
    moving = {(box.id, box.category) for box in sequence.labels(5).boxes if box.dynamic}
    categories = [category for _, category in moving]
    assert categories.count("Car") >= 2
    assert {"Cyclist", "Pedestrian"} <= set(categories)


def test_the_example_is_what_it_is_said_to_be() -> None:
    check_street(STREET)


def test_its_recipe_makes_such_a_street(tmp_path: Path) -> None:
    run_script("make_example.py", tmp_path / "street")
    check_street(tmp_path / "street")


def test_its_movers_are_found_and_its_street_stands_still(cloud: Path) -> None:
    sequence = open_sequence(STREET)
    labels = [sequence.labels(index) for index in range(len(sequence))]
    truth = np.concatenate([frame.dynamic for frame in labels])
    annotated = np.concatenate([frame.annotated for frame in labels])
    with np.load(cloud) as columns:
        found = columns["label"] == MOVING
    truth, found = truth[annotated], found[annotated]
    overlap = np.count_nonzero(truth & found) / np.count_nonzero(truth | found)
    assert overlap > 0.6
    assert np.count_nonzero(found & ~truth) < 0.005 * np.count_nonzero(~truth)


def test_its_poses_are_right(cloud: Path) -> None:
    sequence = open_sequence(STREET)
    truth = np.stack([sequence.labels(index).world_from_sensor for index in range(10)])
    expected = np.linalg.inv(truth[0]) @ truth
    found = np.loadtxt(cloud.with_suffix(".poses.txt")).reshape(-1, 3, 4)
    np.testing.assert_allclose(found[:, :, 3], expected[:, :3, 3], atol=0.1)


def run_script(name: str, *args: object) -> None:
    command = [sys.executable, EXAMPLES / name, *args]
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def test_the_picture_is_drawn(cloud: Path, tmp_path: Path) -> None:
    from matplotlib import image

    run_script("picture.py", cloud, "-o", tmp_path / "picture.png", "--pixels", 200)
    drawn: Any = image.imread(tmp_path / "picture.png")[..., :3]
    assert drawn.std() > 0.05


def test_every_script_is_run_by_a_test() -> None:
    scripts = {path.name for path in EXAMPLES.glob("*.py")}
    source = Path(__file__).read_text()
    assert all(f'"{name}"' in source for name in scripts)
