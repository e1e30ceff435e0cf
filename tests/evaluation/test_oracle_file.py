"""Not only in memory: the cloud that `accumulate` writes holds every point where it belongs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plyfile import PlyData

from lidaraccum.data.window import Window
from lidaraccum.evaluation.truth import Scope, window_truth
from lidaraccum.io.sequences import open_sequence


def written(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Positions (N, 3) and frames (N,) of a cloud on disk."""
    if path.suffix == ".npz":
        with np.load(path) as cloud:
            return cloud["points"], cloud["frame"]
    vertex = PlyData.read(str(path))["vertex"]
    return np.stack([vertex[axis] for axis in "xyz"], axis=1), vertex["scalar_frame"]


@pytest.mark.parametrize("suffix", [".npz", ".ply"])
def test_the_written_cloud_is_the_truth_to_a_millimetre(
    run: Any, street: Path, tmp_path: Path, suffix: str
) -> None:
    out = tmp_path / f"out{suffix}"
    words = ("--method", "oracle", "--poses", "auto", "--reference", "first", "--no-sidecars")
    result = run("accumulate", street, "-o", out, *words)
    assert result.exit_code == 0, result.stderr
    positions, frame = written(out)
    sequence = open_sequence(street)
    truth = window_truth(Window(sequence, 0, len(sequence)), Scope(half_width_m=0))
    moved = 0
    for index, true in enumerate(truth.frames):
        rows = true.known & (true.dynamic | ~np.isin(true.instance, list(truth.movers)))
        assert np.abs(positions[frame == index] - true.in_target)[rows].max() < 1e-3
        moved += np.count_nonzero(true.way_m[rows] > 0.1)
    assert moved > 100
