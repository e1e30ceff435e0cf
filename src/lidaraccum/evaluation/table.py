"""One line of a table: a method's scores, or the paper's, in the units they are read in."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from math import isnan, nan

from lidaraccum.evaluation.scores import Scores
from lidaraccum.metrics.averages import SceneAverage, over_scenes


def _column(title: str, digits: int = 1) -> float:
    return field(default=nan, metadata={"title": title, "digits": digits})


@dataclass(frozen=True)
class Row:
    """Scores of one method on the same windows as the others'; NaN where there is none.

    EPE and poses in centimetres, shares in per cent, time in seconds.
    """

    name: str
    static_epe_cm: float = _column("static EPE cm", 2)
    static_acc_strict: float = _column("AccS %")
    static_acc_relaxed: float = _column("AccR %")
    static_robust_outlier: float = _column("ROutl %")
    still_epe_cm: float = _column("still objects EPE cm", 2)
    dynamic_epe_cm: float = _column("dynamic EPE cm", 2)
    dynamic_median_cm: float = _column("median cm", 2)
    dynamic_acc_strict: float = _column("AccS %")
    dynamic_acc_relaxed: float = _column("AccR %")
    dynamic_robust_outlier: float = _column("ROutl %")
    motion_precision: float = _column("motion P %")
    motion_recall: float = _column("R %")
    motion_iou: float = _column("IoU %")
    foreground_iou: float = _column("foreground IoU %")
    coverage: float = _column("WCov %")
    moving_coverage: float = _column("WCov movers %")
    ape_cm: float = _column("APE cm", 2)
    rpe_cm: float = _column("RPE cm", 2)
    seconds: float = _column("CPU s/window", 2)

    @classmethod
    def titles(cls) -> list[str]:
        """Headings, the name's included."""
        return ["", *(one.metadata["title"] for one in fields(cls)[1:])]

    def cells(self) -> list[str]:
        """What to print under the headings."""
        digits = [one.metadata["digits"] for one in fields(self)[1:]]
        values = list(asdict(self).values())[1:]
        shown = [number(value, few) for value, few in zip(values, digits, strict=True)]
        return [self.name, *shown]


def number(value: float, digits: int) -> str:
    """A number for a table; a dash where there is none."""
    return "-" if isnan(value) else f"{value:.{digits}f}"


def row_of(name: str, scores: Scores) -> Row:
    """The line of a method's scores."""
    static, dynamic = scores.flow.static, scores.flow.dynamic
    return Row(
        name=name,
        static_epe_cm=100 * static.epe_mean,
        static_acc_strict=100 * static.acc_strict,
        static_acc_relaxed=100 * static.acc_relaxed,
        static_robust_outlier=100 * static.robust_outlier,
        still_epe_cm=100 * scores.flow.static_foreground.epe_mean,
        dynamic_epe_cm=100 * dynamic.epe_mean,
        dynamic_median_cm=100 * dynamic.epe_median,
        dynamic_acc_strict=100 * dynamic.acc_strict,
        dynamic_acc_relaxed=100 * dynamic.acc_relaxed,
        dynamic_robust_outlier=100 * dynamic.robust_outlier,
        motion_precision=100 * scores.motion.precision,
        motion_recall=100 * scores.motion.recall,
        motion_iou=100 * scores.motion.iou,
        foreground_iou=100 * scores.foreground.iou,
        coverage=100 * scores.association.weighted_coverage,
        moving_coverage=100 * scores.moving_association.weighted_coverage,
        ape_cm=100 * scores.absolute.translation.mean,
        rpe_cm=100 * scores.relative.translation.mean,
        seconds=scores.seconds_per_window,
    )


@dataclass(frozen=True)
class SceneRow:
    """One method's scores averaged over scenes, each scene counting the same.

    EPE in centimetres, shares in per cent.
    """

    name: str
    static_epe_cm: SceneAverage
    static_acc_relaxed: SceneAverage
    dynamic_epe_cm: SceneAverage
    dynamic_acc_relaxed: SceneAverage
    motion_iou: SceneAverage

    @classmethod
    def titles(cls) -> list[str]:
        """Headings, the name's included."""
        scores = ("static EPE cm", "AccR %", "dynamic EPE cm", "AccR %", "motion IoU %")
        return ["mean ± std over scenes", *scores]

    def cells(self) -> list[str]:
        """What to print under the headings."""
        averages = (
            self.static_epe_cm,
            self.static_acc_relaxed,
            self.dynamic_epe_cm,
            self.dynamic_acc_relaxed,
            self.motion_iou,
        )
        shown = [f"{number(one.mean, 1)} ± {number(one.deviation, 1)}" for one in averages]
        return [
            self.name,
            *(f"{text} ({one.scenes})" for text, one in zip(shown, averages, strict=True)),
        ]


def scene_row_of(name: str, scenes: list[Scores]) -> SceneRow:
    """The line of a method's scores, scene by scene."""
    rows = [row_of(name, scores) for scores in scenes]
    return SceneRow(
        name=name,
        static_epe_cm=over_scenes(row.static_epe_cm for row in rows),
        static_acc_relaxed=over_scenes(row.static_acc_relaxed for row in rows),
        dynamic_epe_cm=over_scenes(row.dynamic_epe_cm for row in rows),
        dynamic_acc_relaxed=over_scenes(row.dynamic_acc_relaxed for row in rows),
        motion_iou=over_scenes(row.motion_iou for row in rows),
    )
