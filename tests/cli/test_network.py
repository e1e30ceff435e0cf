"""`--weights` and `--no-network`, through the user's door."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidaraccum.model.checkpoint import save_network
from lidaraccum.model.network import build_network
from lidaraccum.model.settings import NetworkSettings


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fresh and small, but ours."""
    settings = NetworkSettings(
        extent_m=32.0, base_widths=(16, 24, 32), motion_widths=(32, 48), ego_pillars=64
    )
    path = tmp_path_factory.mktemp("weights") / "fresh.safetensors"
    save_network(build_network(settings), path)
    return path


def report_of(out: Path) -> dict[str, Any]:
    return json.loads(out.with_suffix(".report.json").read_text())


def test_weights_mean_the_network_and_the_report_names_them(
    run: Any, bins: Path, weights: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.npz"
    result = run("accumulate", bins, "-o", out, "--weights", weights)
    assert result.exit_code == 0, result.stderr
    report = report_of(out)
    assert report["weights"] == hashlib.sha256(weights.read_bytes()).hexdigest()
    assert report["settings"]["method"] == "network"
    assert "torch" in report["versions"]


def test_no_network_is_label_free(run: Any, bins: Path, tmp_path: Path) -> None:
    clouds = []
    for name, option in (("a", ["--no-network"]), ("b", ["--method", "label-free"])):
        out = tmp_path / f"{name}.npz"
        assert run("accumulate", bins, "-o", out, *option).exit_code == 0
        report = report_of(out)
        assert (report["weights"], report["settings"]["method"]) == (None, "label-free")
        with np.load(out) as columns:
            clouds.append(dict(columns))
    for name, column in clouds[0].items():
        np.testing.assert_array_equal(column, clouds[1][name])


def test_without_weights_geometry_alone_works_without_complaint(
    run: Any, bins: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.npz"
    result = run("accumulate", bins, "-o", out)
    assert result.exit_code == 0
    assert "Warning" not in result.stderr
    assert report_of(out)["settings"]["method"] == "label-free"


def test_with_shipped_weights_the_network_runs_by_default(
    run: Any, bins: Path, weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lidaraccum.model.weights.shipped_weights", lambda: weights)
    out = tmp_path / "out.npz"
    assert run("accumulate", bins, "-o", out).exit_code == 0
    assert report_of(out)["settings"]["method"] == "network"
    assert report_of(out)["weights"] == hashlib.sha256(weights.read_bytes()).hexdigest()


@pytest.mark.parametrize("options", [["--method", "network"], ["--weights", "gone.safetensors"]])
def test_weights_that_are_not_there_are_said_so(
    run: Any, bins: Path, tmp_path: Path, options: list[str]
) -> None:
    result = run("accumulate", bins, "-o", tmp_path / "out.npz", *options)
    assert result.exit_code == 3
    assert result.stderr.strip().splitlines()[-1].startswith("Error: ")
    assert not list(tmp_path.glob("out*"))


@pytest.mark.parametrize("content", [b"", b"not weights at all", b"\x08\0\0\0\0\0\0\0{}      "])
def test_a_file_that_holds_none_of_our_weights_is_refused(
    run: Any, bins: Path, tmp_path: Path, content: bytes
) -> None:
    other = tmp_path / "other.safetensors"
    other.write_bytes(content)
    result = run("accumulate", bins, "-o", tmp_path / "out.npz", "--weights", other)
    assert result.exit_code == 3
    (said,) = [line for line in result.stderr.splitlines() if line.startswith("Error")]
    assert "other.safetensors" in said
    assert not list(tmp_path.glob("out*"))


def test_asking_for_both_is_refused(run: Any, bins: Path, weights: Path, tmp_path: Path) -> None:
    for options in (
        ["--no-network", "--weights", weights],
        ["--no-network", "--method", "network"],
        ["--method", "ego-only", "--weights", weights],
    ):
        assert run("accumulate", bins, "-o", tmp_path / "out.npz", *options).exit_code == 2


def test_config_shows_the_method_that_comes_of_it(run: Any, weights: Path) -> None:
    shown = json.loads(run("config", "--weights", weights, "--json").stdout)
    assert (shown["method"], shown["weights"]) == ("network", str(weights))
    shown = json.loads(run("config", "--no-network", "--json").stdout)
    assert shown["method"] == "label-free"


def test_evaluate_scores_the_network(run: Any, weights: Path, tmp_path: Path) -> None:
    drive = tmp_path / "drive"
    made = run("simulate", "-o", drive, "--seed", 7, "--frames", 2, "--sensor", "VLP-16")
    assert made.exit_code == 0, made.stderr
    words = ("--window", 2, "--given-poses", "--method", "network", "--weights", weights)
    result = run("evaluate", drive, *words, "--json")
    assert result.exit_code == 0, result.stderr
    (method,) = json.loads(result.stdout)["methods"]
    assert (method["method"], method["told"]) == ("network", "nothing")
    assert method["weights"] == hashlib.sha256(weights.read_bytes()).hexdigest()


def test_evaluate_without_weights_says_so(run: Any, tmp_path: Path) -> None:
    result = run("evaluate", tmp_path, "--method", "network")
    assert result.exit_code == 3
    assert "--weights" in result.stderr
