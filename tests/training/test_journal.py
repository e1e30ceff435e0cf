"""The diary of a run that was cut short reads as if it had not been."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lidaraccum.training.journal import Journal


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_lines_of_steps_that_were_lost_are_dropped(tmp_path: Path) -> None:
    path = tmp_path / "metrics.jsonl"
    journal = Journal(path, 0)
    for step in range(1, 6):
        journal.note("loss", step, float(step), {"total": 1.0 / step})
    kept = lines(path)[:3]
    with path.open("a") as file:
        file.write('{"kind": "loss", "st')
    again = Journal(path, 3)
    assert lines(path) == kept
    again.note("loss", 4, 9.0, {"total": 0.5})
    assert [entry["step"] for entry in lines(path)] == [1, 2, 3, 4]
    assert lines(path)[-1]["seconds"] == 9.0


def test_a_run_from_the_start_forgets_what_lay_there(tmp_path: Path) -> None:
    path = tmp_path / "metrics.jsonl"
    Journal(path, 0).note("loss", 1, 0.0, {"total": 1.0})
    Journal(path, 0)
    assert lines(path) == []


def test_what_is_no_number_is_null(tmp_path: Path) -> None:
    path = tmp_path / "metrics.jsonl"
    Journal(path, 0).note("score", 1, 0.0, {"a": float("nan"), "b": float("inf"), "c": 0.0})
    assert "NaN" not in path.read_text()
    assert [lines(path)[0][name] for name in "abc"] == [None, None, 0.0]
