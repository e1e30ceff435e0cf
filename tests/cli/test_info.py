"""`lidaraccum info`, through the user's door."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np


def test_it_says_what_is_there(run: Any, bins: Path, drive: Any) -> None:
    result = run("info", bins, "--json", "--rate", 10)
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["sequence"]["frames"] == 6
    assert found["sequence"]["rate_hz"] == 10
    assert found["inspection"]["beams"] == 24
    assert found["inspection"]["fields"] == ["x", "y", "z", "intensity"]
    counts = [len(points) for points in drive.frames]
    assert found["inspection"]["points_per_frame"] == int(np.median(counts))


def test_people_are_told_the_same(run: Any, bins: Path) -> None:
    result = run("info", bins)
    assert result.exit_code == 0, result.stderr
    for word in ("6 at", "24 beams", "intensity"):
        assert word in result.stdout


def test_one_frame_is_enough_to_look_at(run: Any, bins: Path) -> None:
    result = run("info", bins / "frame_0.bin")
    assert result.exit_code == 0, result.stderr


def test_nothing_there(run: Any, tmp_path: Path) -> None:
    assert run("info", tmp_path / "missing").exit_code == 3
