"""`lidaraccum evaluate`, through the user's door."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two short drives, as `simulate --count` makes it."""
    from click.testing import CliRunner

    from lidaraccum.cli.main import cli

    folder = tmp_path_factory.mktemp("evaluate") / "drives"
    words = ("simulate", "-o", folder, "--frames", 3, "--sensor", "VLP-16", "--count", 2)
    result = CliRunner().invoke(cli, [*map(str, words), "--seed", "7", "--format", "ply"])
    assert result.exit_code == 0, result.stderr
    return folder


def test_a_folder_of_drives_is_scored_scene_by_scene(run: Any, drives: Path) -> None:
    words = ("--window", 3, "--method", "ego-only", "--method", "oracle", "--given-poses")
    result = run("evaluate", drives, *words, "--per-scene", "--by-gap")
    assert result.exit_code == 0, result.stderr
    assert "2 windows of 3 frames from 2 sequences" in result.stdout
    assert "true poses given" in result.stdout
    assert "| oracle |" in result.stdout
    assert "| paper, Waymo T=5 |" in result.stdout
    assert "By scene" in result.stdout
    assert "oracle, dynamic" in result.stdout


def test_the_report_is_written_and_json_goes_to_stdout(
    run: Any, drives: Path, tmp_path: Path
) -> None:
    page = tmp_path / "report.html"
    drive = drives / "000007"
    words = ("--window", 2, "--stride", 2, "--by-length", "2..3", "--given-poses")
    result = run("evaluate", drive, *words, "-o", page, "--json")
    assert result.exit_code == 0, result.stderr
    scored = json.loads(result.stdout)["methods"][0]
    assert scored["windows"] == 1
    assert [one["frames"] for one in scored["by_length"]] == [2, 3]
    assert page.read_text().startswith("<!doctype html>")
    assert run("evaluate", drive, *words, "-o", page).exit_code == 2


def test_all_methods_can_be_asked_for_at_once(run: Any, drives: Path) -> None:
    from lidaraccum.evaluation.baselines import METHODS

    result = run("evaluate", drives / "000007", "--window", 2, "--method", "all")
    assert result.exit_code == 0, result.stderr
    for method in METHODS:
        assert f"| {method.name} |" in result.stdout
        assert f"{method.name}: {method.told}" in result.stdout


def test_windows_of_the_test_set_are_made_on_demand(run: Any) -> None:
    words = ("--simulated", 1, "--still-shutter", "--given-poses", "--method", "oracle")
    result = run("evaluate", *words, "--window", 2, "--json")
    assert result.exit_code == 0, result.stderr
    scored = json.loads(result.stdout)["methods"][0]
    assert scored["scores"]["static_epe_cm"] < 0.1


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ((), 2, "--simulated"),
        (("here", "--simulated", "3"), 2, "--simulated"),
        (("--simulated", "1", "--method", "magic"), 2, "magic"),
        (("--simulated", "1", "--by-length", "a..b"), 2, "a..b"),
        (("--simulated", "1", "-o", "report.pdf"), 2, ".pdf"),
        (("no-such-folder",), 3, "no-such-folder"),
    ],
)
def test_what_makes_no_sense_is_said_before_any_work(
    run: Any, words: tuple[str, ...], code: int, said: str
) -> None:
    result = run("evaluate", *words)
    assert result.exit_code == code
    assert said in result.stderr


def test_frames_without_labels_cannot_be_scored(run: Any, bins: Path) -> None:
    result = run("evaluate", bins)
    assert result.exit_code == 3
    assert "no labels" in result.stderr
