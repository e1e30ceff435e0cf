"""The way along what has no planes across: tunnels, walls without end.

Planes fix every other direction there; along this one sight lines decide between motions, and where
they do not either, nothing does, which is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid
from lidaraccum.registration.icp import SCORE_GATE_M, align
from lidaraccum.registration.sightlines import Sight, gain
from lidaraccum.registration.surface_map import SurfaceMap

LEANING = 0.26
"""Planes that lean along a direction by less than 15 degrees are taken to lie along it: what they
lean is roughness, or a ring's place."""

OPEN_BELOW = 0.035
"""Mean squared lean, among all planes, of those that face along a direction, below which it is
open. In streets it is 0.04 to 0.2; in tunnels where rings alone spoke for standing, up to 0.03."""

SURE = 3.0
"""Standard deviations by which sight lines must prefer a motion to be believed against planes."""

APART_M = 0.3
"""Motions differ, along the way, from here on."""

STATION_M, STEP_M, FINE_STEP_M = 1.0, 0.1, 0.02
"""Steps along the way: between alignments, between looks, between the last looks."""


def open_axis(
    surface: SurfaceMap, points: NDArray[np.float64], pose: rigid.Pose
) -> NDArray[np.float64] | None:
    """The direction (3,), world, that no plane under points (M, 3) fixes; None where all are."""
    matches = surface.match(rigid.transform(pose, points).T)
    weights = matches.weights * (np.abs(matches.distances) < SCORE_GATE_M)
    total = float(weights.sum())
    if total <= 0:
        return None
    spread = (matches.normals * weights) @ matches.normals.T / total
    axis = np.linalg.eigh(spread)[1][:, 0]
    lean = (axis @ matches.normals) ** 2
    across = float((weights * lean)[lean > LEANING**2].sum())
    return np.asarray(axis) if across < OPEN_BELOW * total else None


@dataclass(frozen=True, eq=False)
class Steady:
    """A steady motion of a few frames.

    Attributes:
        poses: (4, 4) of each, in the first one's coordinates.
        is_clear: Whether sight lines prefer it to all that are clearly others. Standing still never
            is: an edge that only rings told of travels with them.
    """

    poses: list[rigid.Pose]
    is_clear: bool


class SteadyMotion:
    """Constant motions of a few frames along a direction that planes leave open.

    Args:
        sights: The frames, with the poses that planes gave them.
        steps: (T,) frame intervals since the first.
        surface: The planes of the first alone, in its coordinates.
        axis: (3,) the open direction, the first frame's coordinates.
    """

    def __init__(
        self,
        sights: Sequence[Sight],
        steps: NDArray[np.float64],
        surface: SurfaceMap,
        axis: NDArray[np.float64],
    ) -> None:
        self._sights, self._steps = sights, steps
        self._surface, self.axis = surface, axis

    def best(self, reach_m: float) -> Steady:
        """The motion that sight lines like best, the way of a step within reach."""
        count = np.ceil(reach_m / STATION_M)
        places = STATION_M * np.arange(-count, count + 1)
        rails = np.stack([self._on_rail(place) for place in places])
        looks = np.arange(-reach_m, reach_m + STEP_M / 2, STEP_M)
        coarse = self._agreements(_between(rails, places, looks))
        mean = np.array([_mean_known(one) for one in coarse])
        middle = looks[int(np.argmax(mean))]
        finer = np.arange(middle - STEP_M, middle + STEP_M, FINE_STEP_M)
        motions = _between(rails, places, finer)
        fine = self._agreements(motions)
        at = int(np.argmax([_mean_known(one) for one in fine]))
        apart = np.flatnonzero(np.abs(looks - finer[at]) > APART_M)
        rival = coarse[apart[int(np.argmax(mean[apart]))]] if len(apart) else fine[at]
        moves = abs(float(finer[at])) > APART_M
        return Steady(list(motions[at]), is_clear=moves and gain(fine[at], rival) > SURE)

    def agreement(self, poses: Sequence[rigid.Pose]) -> NDArray[np.float64]:
        """What all pairs of frames say of their poses (4, 4): (K,)."""
        return self._agreements(np.stack(poses)[None])[0]

    def _agreements(self, motions: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same (L, K) of many motions, each of all frames (L, T, 4, 4)."""
        said = []
        for i, j in combinations(range(len(self._sights)), 2):
            between = rigid.invert(motions[:, i]) @ motions[:, j]
            said.append(self._sights[i].agreement(self._sights[j], between))
        return np.concatenate(said, axis=1)

    def _on_rail(self, place_m: float) -> NDArray[np.float64]:
        """Twists (T, 6) to the frames, so far along the axis a step, all else as planes have it."""
        first = rigid.invert(self._sights[0].world_from_sensor)
        twists = [np.zeros(6)]
        for sight, steps in zip(self._sights[1:], self._steps[1:], strict=True):
            pose = first @ sight.world_from_sensor
            pose[:3, 3] = self.axis * place_m * steps
            twists.append(
                rigid.logarithm(align(self._surface, sight.few, pose, iterations=8, rail=self.axis))
            )
        return np.stack(twists)


def _between(
    rails: NDArray[np.float64], stations: NDArray[np.float64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Poses (L, T, 4, 4) at places (L,) among stations (S,), each with its twists (S, T, 6)."""
    after = np.clip(np.searchsorted(stations, places), 1, len(stations) - 1)
    share = (places - stations[after - 1]) / (stations[after] - stations[after - 1])
    twists = rails[after - 1] + share[:, None, None] * (rails[after] - rails[after - 1])
    flat = twists.reshape(-1, 6)
    return rigid.exponentials(flat, np.ones(len(flat))).reshape(*twists.shape[:2], 4, 4)


def _mean_known(agreement: NDArray[np.float64]) -> float:
    """The mean of what sight lines say; less than any where they say nothing."""
    known = agreement[np.isfinite(agreement)]
    return float(known.mean()) if len(known) else -np.inf
