"""Scene flow by what the points belong to: static and dynamic apart, and the three-way EPE."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lidaraccum.errors import InputError
from lidaraccum.metrics.flow import BoolArray, FlowErrors, FlowSummary


@dataclass(frozen=True)
class ThreeWayEpe:
    """Mean EPE of three parts, each counting the same, metres; NaN for a part without points.

    Source: Chodosh et al., "Re-Evaluating LiDAR Scene Flow" (WACV 2024), and the scene flow
    challenge of Argoverse 2, which scores pairs 100 ms apart, near the car and without ground.
    """

    foreground_dynamic: float
    foreground_static: float
    background_static: float

    @property
    def mean(self) -> float:
        """Mean of the three; NaN when one of them is: with two it would be another score."""
        return (self.foreground_dynamic + self.foreground_static + self.background_static) / 3


@dataclass(frozen=True, eq=False)
class FlowByPart:
    """Summaries of the four disjoint parts; all other groups are sums of them.

    Attributes:
        static_background: Neither movable nor moving.
        static_foreground: Movable but still.
        dynamic_foreground: Movable and moving (true speed over 0.5 m/s).
        dynamic_background: Moving, though not of a movable class; most data sets have none.
    """

    static_background: FlowSummary
    static_foreground: FlowSummary
    dynamic_foreground: FlowSummary
    dynamic_background: FlowSummary

    @classmethod
    def pool(cls, parts: Iterable[FlowByPart]) -> FlowByPart:
        """All points of several; no part at all gives summaries of no points."""
        nothing = FlowSummary.pool(())
        return sum(parts, start=cls(nothing, nothing, nothing, nothing))

    def __add__(self, other: FlowByPart) -> FlowByPart:
        return FlowByPart(
            self.static_background + other.static_background,
            self.static_foreground + other.static_foreground,
            self.dynamic_foreground + other.dynamic_foreground,
            self.dynamic_background + other.dynamic_background,
        )

    @property
    def static(self) -> FlowSummary:
        """The paper's static part: all that does not move, movable or not.

        The authors' code agrees in the table over points; its statistics per scene take the
        movable points for the static ones, by a slip.
        """
        return self.static_background + self.static_foreground

    @property
    def dynamic(self) -> FlowSummary:
        """The paper's dynamic foreground: all that moves."""
        return self.dynamic_foreground + self.dynamic_background

    @property
    def everything(self) -> FlowSummary:
        """All points."""
        return self.static + self.dynamic

    @property
    def three_way(self) -> ThreeWayEpe:
        """The three-way EPE of Argoverse 2, on whatever points were selected before."""
        return ThreeWayEpe(
            foreground_dynamic=self.dynamic_foreground.epe_mean,
            foreground_static=self.static_foreground.epe_mean,
            background_static=self.static_background.epe_mean,
        )


def summarise_by_part(errors: FlowErrors, dynamic: BoolArray, foreground: BoolArray) -> FlowByPart:
    """Summaries of errors of N points by the truth about them, (N,) bool each.

    Raises:
        InputError: The masks are not bool, or of another length than the errors.
    """
    for name, mask in (("dynamic", dynamic), ("foreground", foreground)):
        if mask.shape != (len(errors),) or mask.dtype != np.bool_:
            raise InputError(f"{name} must be ({len(errors)},) bool, not {mask.shape} {mask.dtype}")
    return FlowByPart(
        static_background=errors.select(~dynamic & ~foreground).summary(),
        static_foreground=errors.select(~dynamic & foreground).summary(),
        dynamic_foreground=errors.select(dynamic & foreground).summary(),
        dynamic_background=errors.select(dynamic & ~foreground).summary(),
    )
