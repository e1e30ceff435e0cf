"""What the journal says is what is drawn."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import pytest

from lidaraccum.errors import MissingDependencyError
from lidaraccum.training.curves import LOSSES, METRES, SHARES, draw_curves, read_curves
from lidaraccum.training.journal import Journal

PNG = b"\x89PNG"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    journal = Journal(tmp_path / "metrics.jsonl", 0)
    for step in range(1, 5):
        journal.note("loss", step, 0.0, {"total": 1.0 / step, "ego": 0.5, "rate": 1e-3})
        shares = {"motion_iou": step / 4, "coverage": math.nan if step < 3 else 0.5}
        journal.note("score", step, 0.0, {**shares, "ego_epe_m": 0.1, "object_epe_m": math.nan})
    return tmp_path


def test_curves_are_the_journal_read_by_kind(folder: Path) -> None:
    metrics = folder / "metrics.jsonl"
    total, ego = read_curves(metrics, "loss", LOSSES)
    assert (total.name, ego.name) == ("total", "ego")
    assert list(total.steps) == [1, 2, 3, 4]
    assert list(total.values) == pytest.approx([1, 1 / 2, 1 / 3, 1 / 4], abs=1e-6)


def test_what_was_null_is_a_gap_and_what_always_was_is_no_curve(folder: Path) -> None:
    metrics = folder / "metrics.jsonl"
    coverage = next(one for one in read_curves(metrics, "score", SHARES) if one.name == "coverage")
    assert [math.isnan(value) for value in coverage.values] == [True, True, False, False]
    assert [one.name for one in read_curves(metrics, "score", METRES)] == ["ego_epe_m"]


def test_a_line_cut_short_is_passed_over(folder: Path) -> None:
    metrics = folder / "metrics.jsonl"
    before = read_curves(metrics, "loss", LOSSES)
    with metrics.open("a") as file:
        file.write('{"kind": "loss", "step"')
    assert read_curves(metrics, "loss", LOSSES) == before


def test_the_picture_is_redrawn_whole(folder: Path) -> None:
    picture = draw_curves(folder)
    first = picture.read_bytes()
    Journal(folder / "metrics.jsonl", 4).note("loss", 5, 0.0, {"total": 9.0})
    assert draw_curves(folder) == picture
    assert picture.read_bytes().startswith(PNG)
    assert picture.read_bytes() != first
    assert sorted(path.name for path in folder.iterdir()) == ["curves.png", "metrics.jsonl"]


def test_a_run_without_a_line_has_an_empty_picture(tmp_path: Path) -> None:
    assert draw_curves(tmp_path).read_bytes().startswith(PNG)


def test_without_matplotlib_the_extra_is_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingDependencyError, match="extra 'train'"):
        draw_curves(folder)
    assert not (folder / "curves.png").exists()


def test_all_names_are_scores_or_losses() -> None:
    from dataclasses import fields

    from lidaraccum.training.objective import Losses
    from lidaraccum.training.scores import Scores

    assert set(LOSSES) <= {one.name for one in fields(Losses)}
    assert set(SHARES) | set(METRES) <= {one.name for one in fields(Scores)}
