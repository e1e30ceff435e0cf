"""Ratios and means that say NaN, rather than fail or flatter, when there is nothing to average."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray


def ratio(part: float, whole: float) -> float:
    """``part / whole``; NaN when ``whole`` is zero: nothing was there to be scored."""
    return part / whole if whole else nan


def ratios(parts: NDArray[Any], wholes: NDArray[Any] | float) -> NDArray[np.float64]:
    """`ratio` for arrays of one shape; NaN where ``wholes`` is zero."""
    parts, wholes = np.broadcast_arrays(np.asarray(parts, np.float64), wholes)
    return np.divide(parts, wholes, out=np.full(parts.shape, nan), where=wholes != 0)


def mean_of_known(values: NDArray[Any]) -> float:
    """Mean of the values that are not NaN; NaN when there is none."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else nan


@dataclass(frozen=True)
class SceneAverage:
    """One score over scenes, as in the paper's second table (supplement, "Results averaged ...").

    Attributes:
        mean: Mean over the scenes in which the score is defined; NaN when there is none.
        deviation: Standard deviation over those scenes (of the population: divided by their
            number); NaN when there is none. The paper does not say which of the two it prints.
        scenes: How many scenes those are.
        undefined: Scenes left out because the score is NaN there (no dynamic points, say).
    """

    mean: float
    deviation: float
    scenes: int
    undefined: int


def over_scenes(values: Iterable[float]) -> SceneAverage:
    """Average one score over scenes, one value a scene, each scene counting the same."""
    scores = np.fromiter(values, dtype=np.float64)
    known = scores[~np.isnan(scores)]
    return SceneAverage(
        mean=mean_of_known(scores),
        deviation=float(known.std()) if len(known) else nan,
        scenes=len(known),
        undefined=len(scores) - len(known),
    )
