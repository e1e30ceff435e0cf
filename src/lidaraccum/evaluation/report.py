"""An evaluation into a file, in the format of its suffix."""

from __future__ import annotations

from pathlib import Path

from lidaraccum.errors import SettingsError
from lidaraccum.evaluation.evaluate import EvaluationReport
from lidaraccum.evaluation.report_json import as_json
from lidaraccum.evaluation.report_page import html
from lidaraccum.evaluation.report_tables import markdown
from lidaraccum.io.atomic import check_free, write_text

FORMATS = (".json", ".md", ".html")


def check_report(path: Path, *, overwrite: bool) -> None:
    """Refuse a report that cannot be written, before the work is done.

    Raises:
        SettingsError: No report has this suffix.
        OutputExistsError: It exists and may not be replaced.
    """
    if path.suffix not in FORMATS:
        raise SettingsError(
            f"a report cannot be written as {path.suffix!r}", hint=f"one of {', '.join(FORMATS)}"
        )
    check_free(path, overwrite)


def write_report(path: Path, report: EvaluationReport, *, overwrite: bool = False) -> None:
    """Write a report with all its sections.

    Raises:
        SettingsError: No report has this suffix.
        OutputExistsError: It exists and may not be replaced.
    """
    check_report(path, overwrite=overwrite)
    texts = {".json": as_json, ".html": html, ".md": markdown}
    write_text(path, texts[path.suffix](report), overwrite=overwrite)
