"""`lidaraccum benchmark`, through the user's door."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest


def test_it_tells_stages_frames_windows_and_memory(
    run: Any, bins: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "kiss_icp", None)
    result = run("benchmark", bins, "--repeat", 1, "--window", 3)
    assert result.exit_code == 0, result.stderr
    for words in ("register, a frame", "a streamed frame", "a window of 3", "Peak memory"):
        assert words in result.stdout
    assert "kiss-icp is not installed" in result.stdout
    assert "kiss-icp is left out" in result.stderr


def test_json_holds_the_same(run: Any, bins: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "kiss_icp", None)
    result = run("benchmark", bins, "--frames", "0:3", "--repeat", 1, "--window", 3, "--json")
    assert result.exit_code == 0, result.stderr
    report = json.loads(result.stdout, parse_constant=pytest.fail)
    assert report["frames"] == 3
    assert report["rivals"][0]["ratio"] is None
    assert report["rivals"][1]["ratio"] > 0


def test_too_few_frames_are_unreadable_input(run: Any, bins: Path) -> None:
    result = run("benchmark", bins, "--frames", "0:2")
    assert result.exit_code == 3
    assert "2 frames" in result.stderr
