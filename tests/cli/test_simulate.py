"""`lidaraccum simulate`, through the user's door: what it writes, the other commands read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np


def content(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_a_drive_can_be_accumulated_with_its_own_labels(run: Any, tmp_path: Path) -> None:
    drive = tmp_path / "drive"
    made = run("simulate", "-o", drive, "--frames", 3, "--sensor", "VLP-16", "--seed", 3)
    assert made.exit_code == 0, made.stderr
    assert json.loads((drive / "meta.json").read_text())["sensor"] == "VLP-16"
    out = tmp_path / "out.npz"
    result = run("accumulate", drive, "-o", out, "--method", "oracle", "--poses", "auto")
    assert result.exit_code == 0, result.stderr
    with np.load(out) as cloud:
        assert set(np.unique(cloud["label"])) >= {0, 1}
        assert np.bincount(cloud["frame"]).shape == (3,)


def test_the_same_seed_gives_the_same_bytes_in_another_process(run: Any, tmp_path: Path) -> None:
    alone, together = tmp_path / "alone", tmp_path / "together"
    common = ("--frames", 2, "--sensor", "VLP-16")
    assert run("simulate", "-o", alone, "--seed", 12, *common).exit_code == 0
    result = run("simulate", "-o", together, "--seed", 11, "--count", 2, "--jobs", 2, *common)
    assert result.exit_code == 0, result.stderr
    assert sorted(path.name for path in together.iterdir()) == ["000011", "000012"]
    assert content(alone) == content(together / "000012")
    assert content(together / "000011") != content(together / "000012")


def test_a_drive_is_not_replaced_unless_told(run: Any, tmp_path: Path) -> None:
    drive = tmp_path / "drive"
    drive.mkdir()
    assert run("simulate", "-o", drive, "--frames", 2).exit_code == 2
    assert not list(drive.iterdir())


def test_an_unknown_sensor_is_refused_with_the_known_ones(run: Any, tmp_path: Path) -> None:
    result = run("simulate", "-o", tmp_path / "drive", "--sensor", "SICK")
    assert result.exit_code == 2
    assert "HDL-64E" in result.stderr
