"""Reports say the same in three formats."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lidaraccum.errors import OutputExistsError, SettingsError
from lidaraccum.evaluation.evaluate import EvaluationReport, EvaluationSettings, evaluate
from lidaraccum.evaluation.report import write_report
from lidaraccum.evaluation.report_tables import Sections, markdown
from lidaraccum.io.sequences import open_sequence


@pytest.fixture(scope="module")
def report(street: Path) -> EvaluationReport:
    settings = EvaluationSettings(
        methods=("ego-only", "oracle"), length=3, lengths=(2, 3), given_poses=True
    )
    return evaluate([open_sequence(street)], settings)


def test_json_holds_every_figure_and_no_nan(report: EvaluationReport, tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    write_report(path, report)
    content = json.loads(path.read_text(), parse_constant=pytest.fail)
    assert [one["method"] for one in content["methods"]] == ["ego-only", "oracle"]
    oracle = content["methods"][1]
    assert oracle["scores"]["dynamic_epe_cm"] < 0.1
    assert oracle["by_gap"]["frames"] == [1, 2]
    assert [one["frames"] for one in oracle["by_length"]] == [2, 3]
    assert len(oracle["scenes"]) == 1
    assert content["paper"][0]["static_epe_cm"] == 2.8
    assert content["methods"][0]["scores"]["motion_precision"] is None


def test_html_is_one_page_that_needs_nothing_else(report: EvaluationReport, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_report(path, report)
    page = path.read_text()
    assert page.count("<svg") == 4
    assert page.count("<polyline") == 8
    assert not any(word in page for word in ("http", "<script", "<link", "src="))


def test_markdown_has_the_paper_beside_ours_and_only_the_sections_asked_for(
    report: EvaluationReport,
) -> None:
    short, whole = markdown(report, Sections(False, False, False)), markdown(report)
    for text in (short, whole):
        assert "| oracle |" in text
        assert "| paper, Waymo T=5 | 2.80 |" in text
        assert "by frames in a window" in text
    assert "By scene" in whole
    for kind in ("range", "kind", "object speed", "ego speed", "sensor"):
        assert f"### By {kind}" in whole
    assert "### By" not in short
    for table in whole.split("###")[1:]:
        rows = [line for line in table.splitlines() if line.startswith("|")]
        assert len({row.count("|") for row in rows}) == 1


def test_an_existing_report_is_kept_and_an_unknown_format_refused(
    report: EvaluationReport, tmp_path: Path
) -> None:
    path = tmp_path / "report.md"
    path.write_text("mine")
    with pytest.raises(OutputExistsError):
        write_report(path, report)
    assert path.read_text() == "mine"
    write_report(path, report, overwrite=True)
    assert path.read_text() == markdown(report)
    with pytest.raises(SettingsError, match="json"):
        write_report(tmp_path / "report.pdf", report)
