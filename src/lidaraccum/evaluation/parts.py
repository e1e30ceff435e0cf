"""Scores by part: how far away, what, how fast, seen from what. Where a method is weak shows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.accumulation import BACKGROUND, MOVING, AccumulatedFrame
from lidaraccum.evaluation.categories import CATEGORIES
from lidaraccum.evaluation.truth import FrameTruth, WindowTruth
from lidaraccum.metrics.averages import ratio

RANGE_EDGES_M = (0.0, 5.0, 10.0, 20.0, 30.0, 40.0, inf)
SPEED_EDGES_MPS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, inf)
EGO_EDGES_MPS = (0.0, 1.0, 5.0, 10.0, 15.0, 20.0, inf)


def _names(edges: tuple[float, ...], unit: str) -> tuple[str, ...]:
    return tuple(
        f"from {low:g} {unit}" if high == inf else f"{low:g} to {high:g} {unit}"
        for low, high in pairwise(edges)
    )


SENSOR = "sensor"
PARTINGS: Mapping[str, tuple[str, ...]] = {
    "range": _names(RANGE_EDGES_M, "m"),
    "kind": CATEGORIES,
    "object speed": _names(SPEED_EDGES_MPS, "m/s"),
    "ego speed": _names(EGO_EDGES_MPS, "m/s"),
    SENSOR: (),
}
"""What points are parted by, and into what; sensors are named by the drives."""


@dataclass(frozen=True)
class PartScore:
    """Counts of a part's points; two added are those of both.

    Attributes:
        moving: Scored points, of all frames, that move.
        found: Of these, called moving.
        alarms: Called moving and do not move.
        movable: Scored points on something that can move.
        named: Of these, called movable.
        dynamic_points: Source points that move and whose place is known.
        dynamic_epe_sum: Sum of their end-point errors, metres.
        static_points: Source points that stand.
        static_epe_sum: Sum of theirs.
    """

    moving: int = 0
    found: int = 0
    alarms: int = 0
    movable: int = 0
    named: int = 0
    dynamic_points: int = 0
    dynamic_epe_sum: float = 0.0
    static_points: int = 0
    static_epe_sum: float = 0.0

    def __add__(self, other: PartScore) -> PartScore:
        names = [one.name for one in fields(self)]
        return PartScore(*(getattr(self, name) + getattr(other, name) for name in names))

    @property
    def precision(self) -> float:
        """Of what is called moving, the share that moves; NaN where nothing is."""
        return ratio(self.found, self.found + self.alarms)

    @property
    def recall(self) -> float:
        """Of what moves, the share that is called so; NaN where nothing moves."""
        return ratio(self.found, self.moving)

    @property
    def foreground_recall(self) -> float:
        """Of what can move, the share that is called so; NaN where nothing can."""
        return ratio(self.named, self.movable)

    @property
    def dynamic_epe_m(self) -> float:
        """Mean end-point error of what moves; NaN without any."""
        return ratio(self.dynamic_epe_sum, self.dynamic_points)

    @property
    def static_epe_m(self) -> float:
        """Mean end-point error of what stands; NaN without any."""
        return ratio(self.static_epe_sum, self.static_points)


Parts = Mapping[str, Mapping[str, PartScore]]
"""By kind and part, in the order of `PARTINGS`."""


def added(parts: Iterable[Parts]) -> Parts:
    """All of several, part by part."""
    total: dict[str, dict[str, PartScore]] = {kind: {} for kind in PARTINGS}
    for one in parts:
        for kind, scores in one.items():
            for name, score in scores.items():
                total[kind][name] = total[kind].get(name, PartScore()) + score
    return {
        kind: {name: scores[name] for name in (PARTINGS[kind] or sorted(scores)) if name in scores}
        for kind, scores in total.items()
    }


def score_parts(
    placed: Sequence[AccumulatedFrame], truth: WindowTruth, target: int, sensor: str
) -> Parts:
    """Score a window's points part by part.

    Args:
        placed: T frames in the target frame's coordinates, all their points in order.
        truth: Of the same frames.
        target: Index of the target frame; its points have no flow.
        sensor: What took the window; empty where nobody says.
    """
    ego = _bins(np.array([_ego_speed(placed, truth)]), EGO_EDGES_MPS)
    frames = []
    for index, (frame, true) in enumerate(zip(placed, truth.frames, strict=True)):
        columns = _columns(frame, true, is_source=index != target)
        part_of = {
            "range": _bins(np.linalg.norm(true.at_stamp, axis=1), RANGE_EDGES_M),
            "kind": true.category,
            "object speed": _bins(np.where(true.dynamic, true.speed_mps, np.nan), SPEED_EDGES_MPS),
            "ego speed": np.repeat(ego, len(true.category)),
            SENSOR: np.zeros_like(true.category),
        }
        frames.append(
            {
                kind: _parted(columns, part, PARTINGS[kind] or (sensor or "not told",))
                for kind, part in part_of.items()
            }
        )
    return added(frames)


def _columns(
    frame: AccumulatedFrame, true: FrameTruth, *, is_source: bool
) -> dict[str, NDArray[Any]]:
    """What each point adds to each count, in the order of `PartScore`."""
    said = frame.label == MOVING
    flowing = true.scored & true.known & is_source
    error = np.linalg.norm(frame.points - true.in_target, axis=1)
    moves, stands = flowing & true.dynamic, flowing & ~true.dynamic
    return {
        "moving": true.scored & true.dynamic,
        "found": true.scored & true.dynamic & said,
        "alarms": true.scored & ~true.dynamic & said,
        "movable": true.scored & true.foreground,
        "named": true.scored & true.foreground & (frame.label != BACKGROUND),
        "dynamic_points": moves,
        "dynamic_epe_sum": np.where(moves, error, 0.0),
        "static_points": stands,
        "static_epe_sum": np.where(stands, error, 0.0),
    }


def _parted(
    columns: dict[str, NDArray[Any]], part: NDArray[np.int64], names: Sequence[str]
) -> dict[str, PartScore]:
    """Sums by part (N,), -1 for none; parts without anything to count are left out."""
    own = part >= 0
    sums = {
        name: np.bincount(part[own], column[own].astype(np.float64), minlength=len(names))
        for name, column in columns.items()
    }
    scores = {}
    for number, name in enumerate(names):
        of_part = {column: float(total[number]) for column, total in sums.items()}
        if any(of_part.values()):
            counts = {one: v if one.endswith("sum") else int(v) for one, v in of_part.items()}
            scores[name] = PartScore(**counts)  # type: ignore[arg-type]
    return scores


def _bins(values: NDArray[np.float64], edges: tuple[float, ...]) -> NDArray[np.int64]:
    """Which of the spans between edges each value (N,) is in, -1 for NaN."""
    number = np.searchsorted(edges, values, side="right") - 1
    return np.where(np.isnan(values), -1, number)


def _ego_speed(placed: Sequence[AccumulatedFrame], truth: WindowTruth) -> float:
    """Metres a second along the true way through the window; NaN where no time goes by."""
    way = np.linalg.norm(np.diff(truth.poses[:, :3, 3], axis=0), axis=1).sum()
    return ratio(float(way), abs(placed[-1].stamp - placed[0].stamp))
