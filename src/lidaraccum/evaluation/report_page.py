"""An evaluation as one HTML page that needs nothing beside it."""

from __future__ import annotations

import math
from html import escape

import numpy as np

from lidaraccum.evaluation.charts import Axes, Line, line_chart, round_ticks
from lidaraccum.evaluation.evaluate import EvaluationReport
from lidaraccum.evaluation.report_tables import (
    PARTS,
    Sections,
    Table,
    epe_by_gap,
    gaps_of,
    summary,
    tables_of,
)

ECDF_AT_M = tuple(np.geomspace(0.001, 10, 81).tolist())
STYLE = (
    "body{font:14px sans-serif;margin:2em;color:#222}table{border-collapse:collapse}"
    "td,th{padding:.25em .6em;text-align:right;border-bottom:1px solid #ddd}"
    "td:first-child{text-align:left;white-space:nowrap}svg{margin-right:1.5em}"
    "svg text{font:11px sans-serif}svg .title{font-weight:bold}"
)


def html(report: EvaluationReport) -> str:
    """The page: what was scored, ECDF and EPE by gap, all tables."""
    said = "".join(f"<p>{escape(sentence)}</p>" for sentence in summary(report))
    charts = "".join([*_ecdf_charts(report), *_gap_charts(report)])
    tables = "".join(_table(table) for table in tables_of(report, Sections()))
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>lidaraccum evaluation</title>'
        f"<style>{STYLE}</style><h1>Evaluation</h1>{said}<div>{charts}</div>{tables}</html>\n"
    )


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(title)}</th>" for title in table.titles)
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in table.rows
    )
    return f"<h2>{escape(table.heading)}</h2><table><tr>{head}</tr>{rows}</table>"


def _ecdf_charts(report: EvaluationReport) -> list[str]:
    at = np.array(ECDF_AT_M)
    charts = []
    for part in PARTS:
        axes = Axes(
            f"Share of {part} points with a smaller EPE",
            "EPE, m",
            (0.001, 0.01, 0.1, 1, 10),
            (0, 0.2, 0.4, 0.6, 0.8, 1),
            log_x=True,
        )
        lines = []
        for one in report.methods:
            flow = one.scores.flow.static if part == "static" else one.scores.flow.dynamic
            shares = flow.distribution.shares_below(at).tolist()
            lines.append(Line(one.method.name, ECDF_AT_M, shares))
        charts.append(line_chart(axes, lines))
    return charts


def _gap_charts(report: EvaluationReport) -> list[str]:
    gaps = gaps_of(report)
    charts = []
    for part in PARTS:
        lines = [
            Line(one.method.name, [float(gap) for gap in gaps], epe_by_gap(one, part, gaps))
            for one in report.methods
        ]
        largest = max((y for line in lines for y in line.y if math.isfinite(y)), default=1.0)
        axes = Axes(
            f"EPE of {part} points, cm",
            "frames between source and target",
            [float(tick) for tick in range(max(gaps) + 1)],
            round_ticks(largest),
        )
        charts.append(line_chart(axes, lines))
    return charts
