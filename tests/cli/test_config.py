"""Where settings come from: flag, environment, file, default - in that order."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def toml(tmp_path: Path) -> Path:
    path = tmp_path / "settings.toml"
    path.write_text('voxel = 0.25\nmax-range = 60.0\ncrop = [-1, -2, 3, 4]\ndeskew = "off"\n')
    return path


def shown(run: Any, *args: object, env: dict[str, str] | None = None) -> dict[str, Any]:
    result = run("config", *args, "--json", env=env)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def test_defaults(run: Any) -> None:
    values = shown(run)
    assert values["voxel"] == 0.0
    assert values["deskew"] == "auto"


def test_the_file_wins_over_defaults(run: Any, toml: Path) -> None:
    values = shown(run, "--config", toml)
    assert (values["voxel"], values["max-range"], values["deskew"]) == (0.25, 60.0, "off")
    assert values["crop"] == [-1, -2, 3, 4]


def test_the_environment_wins_over_the_file(run: Any, toml: Path) -> None:
    values = shown(run, "--config", toml, env={"LIDARACCUM_VOXEL": "0.5"})
    assert (values["voxel"], values["max-range"]) == (0.5, 60.0)


def test_the_flag_wins_over_all(run: Any, toml: Path) -> None:
    env = {"LIDARACCUM_VOXEL": "0.5"}
    assert shown(run, "--config", toml, "--voxel", 0.75, env=env)["voxel"] == 0.75


def test_the_file_can_be_named_in_the_environment(run: Any, toml: Path) -> None:
    assert shown(run, env={"LIDARACCUM_CONFIG": str(toml)})["voxel"] == 0.25


def test_what_is_printed_can_be_read_back(run: Any, toml: Path, tmp_path: Path) -> None:
    printed = run("config", "--config", toml, "--rate", 20)
    assert "# flag" in printed.stdout
    assert "# file" in printed.stdout
    again = tmp_path / "again.toml"
    again.write_text(printed.stdout)
    assert shown(run, "--config", again) == shown(run, "--config", toml, "--rate", 20)


def test_an_unknown_key_is_refused_with_the_nearest_one(run: Any, tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text("voxle = 0.25\n")
    result = run("config", "--config", path)
    assert result.exit_code == 2
    assert "'voxel'" in result.stderr


def test_a_file_that_is_not_toml_is_refused(run: Any, tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text("voxel: 0.25\n")
    assert run("config", "--config", path).exit_code == 2


def test_accumulate_takes_them_too(run: Any, bins: Path, toml: Path, tmp_path: Path) -> None:
    result = run("accumulate", bins, "-o", tmp_path / "out.npz", "--config", toml)
    assert result.exit_code == 0, result.stderr
    settings = json.loads((tmp_path / "out.report.json").read_text())["settings"]
    assert (settings["voxel"], settings["deskew"]) == (0.25, "off")
