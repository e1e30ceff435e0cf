"""The tables of an evaluation, and the same as Markdown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lidaraccum.evaluation import paper
from lidaraccum.evaluation.categories import CATEGORIES
from lidaraccum.evaluation.evaluate import EvaluationReport, MethodReport
from lidaraccum.evaluation.parts import PARTINGS
from lidaraccum.evaluation.table import Row, SceneRow, number, row_of, scene_row_of

PARTS = ("static", "dynamic")


@dataclass(frozen=True)
class Sections:
    """What to show beside the main table.

    Attributes:
        scenes: Averages over scenes.
        gaps: EPE by frames between source and target.
        parts: Scores by range, kind, speed and sensor.
    """

    scenes: bool = True
    gaps: bool = True
    parts: bool = True


@dataclass(frozen=True)
class Table:
    """A heading, a row of titles, rows of cells."""

    heading: str
    titles: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        """The same as Markdown, under its heading."""
        lines = [_line(row) for row in (self.titles, ["---"] * len(self.titles), *self.rows)]
        return "\n".join([f"### {self.heading}", "", *lines])


def tables_of(report: EvaluationReport, sections: Sections) -> list[Table]:
    """All tables of a report, the paper's rows beside ours."""
    rows = [row_of(one.method.name, one.scores) for one in report.methods]
    tables = [Table("Scores", Row.titles(), [row.cells() for row in (*rows, *paper.ROWS)])]
    tables.append(_modern(report))
    if sections.gaps:
        tables.append(_by_gap(report))
    if sections.scenes:
        scenes = [
            scene_row_of(one.method.name, [scene.scores for scene in one.scenes]).cells()
            for one in report.methods
        ]
        tables.append(Table("By scene", SceneRow.titles(), scenes))
    if report.settings.lengths:
        tables.append(_by_length(report))
    if sections.parts:
        tables += [_by_part(report, kind) for kind in PARTINGS]
    return tables


def _modern(report: EvaluationReport) -> Table:
    """Three-way EPE and bucket-normalised error, the scores of the Argoverse 2 challenges."""
    titles = ["", "FD cm", "FS cm", "BS cm", "three-way cm", *CATEGORIES[1:], "mean"]
    rows = []
    for one in report.methods:
        three, speed = one.scores.flow.three_way, one.scores.by_speed
        parts = (three.foreground_dynamic, three.foreground_static, three.background_static)
        errors = [*speed.dynamic_error[1:].tolist(), speed.mean_dynamic_error]
        cells = [number(100 * value, 2) for value in (*parts, three.mean)]
        rows.append([one.method.name, *cells, *(number(value, 3) for value in errors)])
    heading = "Three-way EPE; dynamic error over way gone, by kind and speed (1: as if all stood)"
    return Table(heading, titles, rows)


def gaps_of(report: EvaluationReport) -> list[int]:
    """Frames between source and target that were met."""
    return sorted({gap for one in report.methods for gap in one.scores.by_gap})


def _by_gap(report: EvaluationReport) -> Table:
    gaps = gaps_of(report)
    rows = [
        [f"{one.method.name}, {part}", *(number(value, 2) for value in epe_by_gap(one, part, gaps))]
        for one in report.methods
        for part in PARTS
    ]
    return Table("EPE, cm, by frames between source and target", ["", *map(str, gaps)], rows)


def epe_by_gap(one: MethodReport, part: str, gaps: Sequence[int]) -> list[float]:
    """EPE, centimetres, of one of `PARTS` for each gap."""
    by_gap = one.scores.by_gap
    flows = [by_gap[gap] for gap in gaps]
    picked = [flow.static if part == "static" else flow.dynamic for flow in flows]
    return [100 * flow.epe_mean for flow in picked]


def _by_part(report: EvaluationReport, kind: str) -> Table:
    titles = ["", kind, "moving points", "motion P %", "R %", "movable R %"]
    rows = [
        [
            one.method.name,
            name,
            f"{part.moving:,}",
            *(number(100 * share, 1) for share in (part.precision, part.recall)),
            number(100 * part.foreground_recall, 1),
            *(number(100 * epe, 1) for epe in (part.dynamic_epe_m, part.static_epe_m)),
        ]
        for one in report.methods
        for name, part in one.scores.by_part[kind].items()
    ]
    return Table(f"By {kind}", [*titles, "dynamic EPE cm", "static EPE cm"], rows)


def _by_length(report: EvaluationReport) -> Table:
    lengths = sorted(report.settings.lengths)
    rows = []
    for one in report.methods:
        flows = [one.by_length[length].flow for length in lengths]
        name = one.method.name
        rows.append([f"{name}, static", *(number(100 * f.static.epe_mean, 2) for f in flows)])
        rows.append([f"{name}, dynamic", *(number(100 * f.dynamic.epe_mean, 2) for f in flows)])
    for part, values in (
        ("static", paper.STATIC_EPE_CM_BY_LENGTH),
        ("dynamic", paper.DYNAMIC_EPE_CM_BY_LENGTH),
    ):
        known = dict(zip(paper.LENGTHS, values, strict=True))
        cells = [number(known.get(length, math.nan), 1) for length in lengths]
        rows.append([f"paper, Waymo, {part}", *cells])
    return Table("EPE, cm, by frames in a window", ["", *map(str, lengths)], rows)


def summary(report: EvaluationReport) -> list[str]:
    """What was scored, in sentences."""
    settings, first = report.settings, report.methods[0].scores
    flow = first.flow
    poses = "true poses given" if settings.given_poses else "poses estimated"
    scope = settings.scope
    square = (
        f"in the {2 * scope.half_width_m:g} m square about the sensor"
        if scope.half_width_m
        else "at any distance"
    )
    ground = f"from {scope.above_ground_m:g} m above it" if scope.above_ground_m else "included"
    told = "; ".join(f"{one.method.name}: {one.method.told}" for one in report.methods)
    return [
        f"{first.windows} windows of {settings.length} frames from {len(report.methods[0].scenes)} "
        f"sequences, target {settings.target}, {poses}.",
        f"Scored {square}, annotated points only, ground {ground}: {flow.static.points:,} static "
        f"and {flow.dynamic.points:,} dynamic source points; {first.unknown_points:,} left out "
        "because their object is not seen in the target frame.",
        f"What each is told of the truth: {told}.",
    ]


def markdown(report: EvaluationReport, sections: Sections | None = None) -> str:
    """The report's tables."""
    tables = tables_of(report, sections or Sections())
    parts = ["\n".join(summary(report)), *(table.markdown() for table in tables)]
    return "\n\n".join(parts) + "\n"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
