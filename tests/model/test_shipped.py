"""The weights that come with the package: small, described, and worth having."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidaraccum.model import weights
from lidaraccum.model.checkpoint import load_network
from lidaraccum.model.weights import weights_hash

pytestmark = pytest.mark.shipped

MOST_BYTES = 25_000_000


@pytest.fixture(scope="module")
def shipped() -> Path:
    path = weights.shipped_weights()
    assert path is not None
    return path


def test_they_are_small_and_their_card_is_theirs(shipped: Path) -> None:
    assert shipped.stat().st_size < MOST_BYTES
    card = shipped.with_suffix(".md").read_text()
    assert weights_hash(shipped) in card


def test_every_file_beside_them_can_be_read_too(shipped: Path) -> None:
    for path in shipped.parent.glob(f"*{weights.SUFFIX}"):
        network = load_network(path)
        assert all(bool(np.isfinite(p.detach().numpy()).all()) for p in network.parameters())


def test_on_streets_they_never_saw_they_find_more_than_geometry(run: Any) -> None:
    """Two windows of the test set: what can move, and no less of what does."""
    methods = ("--method", "network", "--method", "cluster-icp")
    result = run("evaluate", "--simulated", 2, *methods, "--json")
    assert result.exit_code == 0, result.stderr
    led, alone = (one["scores"] for one in json.loads(result.stdout)["methods"])
    assert led["foreground_iou"] > 50.0 > alone["foreground_iou"]
    assert led["motion_recall"] > alone["motion_recall"] - 2.0
    assert led["motion_precision"] > 90.0
    assert led["static_epe_cm"] < 1.2 * alone["static_epe_cm"]


def test_they_are_what_accumulate_uses(run: Any, bins: Path, shipped: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.npz"
    assert run("accumulate", bins, "-o", out).exit_code == 0
    report = json.loads(out.with_suffix(".report.json").read_text())
    assert report["settings"]["method"] == "network"
    assert report["weights"] == weights_hash(shipped)
