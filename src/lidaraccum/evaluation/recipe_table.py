"""Recipes beside each other: what their runs came to; and what the factors of a screening do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import isfinite, nan
from typing import Any

import numpy as np

from lidaraccum.evaluation.report_tables import Table
from lidaraccum.evaluation.table import number
from lidaraccum.training.comparison import RunResult
from lidaraccum.training.screening import Screening

LOSSES = ("ego", "foreground", "motion", "offset", "objects")
IOU = (
    ("foreground_iou", "foreground IoU %"),
    ("motion_iou", "motion IoU %, poses true"),
    ("alone_motion_iou", "poses its own"),
)
SCORES = (
    *IOU,
    ("ego_epe_m", "ego EPE cm"),
    ("ego_epe_median_m", "median"),
    ("static_epe_m", "static EPE cm"),
    ("dynamic_epe_m", "dynamic EPE cm"),
    ("dynamic_median_m", "median"),
    ("coverage", "WCov %"),
)


@dataclass(frozen=True)
class Column:
    """A number of each run, and how it is shown.

    Attributes:
        name: In JSON: SI units, shares of 1.
        title: In a table.
        of: Takes it from a run.
        scale: What it is shown times in a table.
        digits: Behind the point.
    """

    name: str
    title: str
    of: Callable[[RunResult], float]
    scale: float = 1.0
    digits: int = 2

    def shown(self, spread: Spread) -> str:
        """A cell: the mean, and where values differ the least and the most."""
        mean, least, most = (
            number(self.scale * value, self.digits)
            for value in (spread.mean, spread.least, spread.most)
        )
        return mean if least == most else f"{mean} ({least}..{most})"


@dataclass(frozen=True)
class Spread:
    """Of one number over seeds, those left out that have none; NaN when no seed has one."""

    mean: float
    least: float
    most: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Of any number of values."""
        known = [value for value in values if isfinite(value)]
        return cls(sum(known) / len(known), min(known), max(known)) if known else cls(nan, nan, nan)


@dataclass(frozen=True)
class Part:
    """Columns that belong together."""

    name: str
    heading: str
    columns: Sequence[Column]


def recipe_tables(recipes: Sequence[str], results: Sequence[RunResult]) -> str:
    """Tables in Markdown, each with a row for every recipe, however many of its runs are done."""
    tables = []
    for part in _parts(results):
        titles = ["", "seeds", *(column.title for column in part.columns)]
        rows = []
        for recipe in recipes:
            runs = _runs(recipe, results)
            cells = [column.shown(_spread(column, runs)) for column in part.columns]
            rows.append([recipe, str(len(runs)), *cells])
        tables.append(Table(part.heading, titles, rows).markdown())
    return (
        "\n\n".join(["Mean (least..most) over seeds; losses at the end of the runs.", *tables])
        + "\n"
    )


def recipe_data(recipes: Sequence[str], results: Sequence[RunResult]) -> list[dict[str, Any]]:
    """The same for JSON: for every recipe its seeds, and mean, least and most by part and name."""
    rows = []
    for recipe in recipes:
        runs = _runs(recipe, results)
        row: dict[str, Any] = {"recipe": recipe, "seeds": [run.seed for run in runs]}
        for part in _parts(results):
            row[part.name] = {one.name: asdict(_spread(one, runs)) for one in part.columns}
        rows.append(row)
    return rows


def effect_tables(screening: Screening, results: Sequence[RunResult]) -> str:
    """Tables in Markdown, each with a row for every factor: what it does when it is high."""
    tables = []
    for part in _parts(results):
        columns = [_effects(screening, column, results) for column in part.columns]
        numbers = np.array([[*effects, chance] for effects, chance in columns]).T
        names = [*screening.factors, "chance, one sigma"]
        rows = [
            [name, *map(_signed, row, part.columns)]
            for name, row in zip(names, numbers.tolist(), strict=True)
        ]
        titles = ["", *(column.title for column in part.columns)]
        tables.append(Table(part.heading, titles, rows).markdown())
    intro = "Mean over the runs in which a factor is high, less that over those in which it is low."
    return "\n\n".join([intro, *tables]) + "\n"


def effect_data(screening: Screening, results: Sequence[RunResult]) -> dict[str, Any]:
    """The same for JSON: by part and column each factor's effect, and one sigma of chance."""
    data: dict[str, Any] = {}
    for part in _parts(results):
        data[part.name] = {}
        for column in part.columns:
            effects, chance = _effects(screening, column, results)
            named = dict(zip(screening.factors, effects.tolist(), strict=True))
            data[part.name][column.name] = {"chance": chance, "factors": named}
    return data


def _effects(
    screening: Screening, column: Column, results: Sequence[RunResult]
) -> tuple[np.ndarray[Any, np.dtype[np.float64]], float]:
    means = [_spread(column, _runs(name, results)).mean for name in screening.runs]
    return screening.effects(np.array(means))


def _signed(value: float, column: Column) -> str:
    shown = number(column.scale * value, column.digits)
    return f"+{shown}" if value > 0 else shown


def _parts(results: Sequence[RunResult]) -> list[Part]:
    """What was learned, then the scores: simulated, and of every recording met."""
    drives = list(dict.fromkeys(name for run in results for name in run.marks.recorded))
    learned = (
        Column("windows", "windows", lambda run: run.windows, digits=0),
        Column("windows_per_second", "windows/s", lambda run: run.windows / run.seconds),
        *map(_loss, LOSSES),
    )
    return [
        Part("learned", "Learned", learned),
        Part("simulated", "Simulated test set", [_score(*names, None) for names in SCORES]),
        *(Part(drive, drive, [_score(*names, drive) for names in IOU]) for drive in drives),
    ]


def _loss(name: str) -> Column:
    return Column(name, name, lambda run: getattr(run.losses, name))


def _score(name: str, title: str, drive: str | None) -> Column:
    """Of a recording, or of the simulated test set; in centimetres or per cent."""

    def of(run: RunResult) -> float:
        scores = run.marks.simulated if drive is None else run.marks.recorded[drive]
        return getattr(scores, name)

    return Column(name, title, of, scale=100.0, digits=1)


def _runs(recipe: str, results: Sequence[RunResult]) -> list[RunResult]:
    return [one for one in results if one.recipe == recipe]


def _spread(column: Column, runs: Sequence[RunResult]) -> Spread:
    return Spread.of([column.of(run) for run in runs])
