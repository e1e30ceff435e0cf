"""Losses and scores of a run as one picture, from its journal."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidaraccum.errors import MissingDependencyError
from lidaraccum.io.atomic import atomic
from lidaraccum.training.state import METRICS_FILE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVES_FILE = "curves.png"
LOSSES = ("total", "ego", "foreground", "motion", "offset", "objects")
SHARES = (
    "foreground_iou", "motion_iou", "motion_precision", "motion_recall", "coverage",
    "static_acc_strict", "dynamic_acc_strict", "dynamic_acc_relaxed", "dynamic_robust_outlier",
)  # fmt: skip
METRES = (
    "ego_epe_m", "static_epe_m", "dynamic_epe_m", "dynamic_median_m", "offset_m", "object_epe_m",
    "object_still_m",
)  # fmt: skip


@dataclass(frozen=True)
class Curve:
    """One number of the journal over the steps; NaN where there was none."""

    name: str
    steps: Sequence[int]
    values: Sequence[float]


def read_curves(metrics: Path, kind: str, names: Sequence[str]) -> list[Curve]:
    """Those of the named numbers that the journal's lines of a kind hold, in the order named.

    A line that a kill cut short is passed over.
    """
    entries = []
    for line in metrics.read_text().splitlines() if metrics.is_file() else []:
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        if entry["kind"] == kind:
            entries.append(entry)
    steps = [entry["step"] for entry in entries]
    return [
        Curve(name, steps, [_number(entry, name) for entry in entries])
        for name in names
        if any(entry.get(name) is not None for entry in entries)
    ]


def _number(entry: Mapping[str, Any], name: str) -> float:
    value = entry.get(name)
    return nan if value is None else float(value)


def draw_curves(folder: Path) -> Path:
    """Draw ``curves.png`` of a run's folder from its ``metrics.jsonl``; an older one is replaced.

    Raises:
        MissingDependencyError: matplotlib is not installed.
        OutputError: The system refuses.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError(
            f"no {CURVES_FILE} is drawn: matplotlib is missing", hint="the extra 'train' has it"
        ) from error
    metrics, picture = folder / METRICS_FILE, folder / CURVES_FILE
    figure = Figure(figsize=(13, 4.2), layout="constrained")
    losses, shares, metres = figure.subplots(1, 3)
    _draw(losses, "loss", read_curves(metrics, "loss", LOSSES), log=True)
    _draw(shares, "share, held out", read_curves(metrics, "score", SHARES), log=False)
    _draw(metres, "metres, held out", read_curves(metrics, "score", METRES), log=True)
    with atomic(picture, overwrite=True) as beside:
        figure.savefig(beside, format="png", dpi=110)
    return picture


def _draw(axes: Axes, title: str, curves: Sequence[Curve], *, log: bool) -> None:
    for curve in curves:
        mark = "." if len(curve.steps) < 3 else ""
        axes.plot(curve.steps, curve.values, mark + "-", label=curve.name, linewidth=1.2)
    axes.set(title=title, xlabel="step")
    if log and any(value > 0 for curve in curves for value in curve.values):
        axes.set_yscale("log")
    if not log:
        axes.set_ylim(0.0, 1.0)
    axes.grid(visible=True, alpha=0.3)
    if curves:
        axes.legend(fontsize=7)
