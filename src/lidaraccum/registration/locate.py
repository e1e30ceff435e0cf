"""Which of several motions a frame made: each scored on the points, the best refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid, voxel
from lidaraccum.registration.icp import Alignment, align, assess
from lidaraccum.registration.proposals import CELL_M, Reach, shift_proposals
from lidaraccum.registration.surface_map import SurfaceMap

COARSE_POINTS = 1200
COARSE_ITERATIONS = 6
SHORTLIST = 8
ENDS = 4
DISTINCT_M, DISTINCT_RAD = 0.3, 0.02
"""Two poses closer than this are one answer."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A pose a frame may have, and where the idea came from."""

    name: str
    world_from_sensor: rigid.Pose


@dataclass(frozen=True, eq=False)
class Located:
    """The best explanation of a frame.

    Attributes:
        hypothesis: Name of the start that led there.
        alignment: The refined pose and its scores.
        rival: Score of the best distinct other answer over this one's; 0 when none was sought.
        rival_distance_m: How far away that other answer lies.
        sighted: Whether sight lines fix what planes leave open.
    """

    hypothesis: str
    alignment: Alignment
    rival: float = 0.0
    rival_distance_m: float = 0.0
    sighted: bool = False


def refine(surface: SurfaceMap, source: NDArray[np.float64], start: Hypothesis) -> Located:
    """Follow one hypothesis to its end."""
    pose = align(surface, source, start.world_from_sensor)
    return Located(start.name, assess(surface, source, pose))


def search(
    surface: SurfaceMap,
    source: NDArray[np.float64],
    starts: Sequence[Hypothesis],
    known: Located | None = None,
) -> Located:
    """Follow every hypothesis on few points and coarse planes, the best few to their end.

    ``known`` is one that was followed to its end before: coarse planes may lead it astray.
    """
    few = source[:: max(1, len(source) // COARSE_POINTS)]
    roughly = [
        (start.name, _aligned_coarsely(surface, few, start.world_from_sensor, level=2))
        for start in starts
    ]
    roughly.sort(key=lambda candidate: -candidate[1].score)
    tried = [
        (name, _aligned_coarsely(surface, few, rough.world_from_sensor, level=1))
        for name, rough in _distinct(roughly)[:SHORTLIST]
    ]
    tried.sort(key=lambda candidate: -candidate[1].score)
    ends = [
        refine(surface, source, Hypothesis(name, coarse.world_from_sensor))
        for name, coarse in _distinct(tried)[:ENDS]
    ]
    ends += [] if known is None else [known]
    ends.sort(key=lambda end: -end.alignment.score)
    best = ends[0]
    rival = next((end for end in ends if are_distinct(_pose(best), _pose(end))), None)
    if rival is None:
        return best
    return Located(
        best.hypothesis,
        best.alignment,
        rival=rival.alignment.score / max(best.alignment.score, 1e-9),
        rival_distance_m=float(np.linalg.norm(_pose(best)[:3, 3] - _pose(rival)[:3, 3])),
    )


def _aligned_coarsely(
    surface: SurfaceMap, few: NDArray[np.float64], start: rigid.Pose, level: int
) -> Alignment:
    pose = align(surface, few, start, finest=level, iterations=COARSE_ITERATIONS)
    return assess(surface, few, pose, finest=1)


def proposed(
    surface: SurfaceMap,
    source: NDArray[np.float64],
    expected: rigid.Pose,
    reach: Reach,
    axes: Sequence[int],
) -> list[Hypothesis]:
    """Hypotheses from correlating pictures of the map and the frame about the expected pose."""
    place = expected[:3, 3]
    target = surface.means.T - place
    turned = source @ expected[:3, :3].T
    thin_source = turned[voxel.thin(turned, CELL_M)]
    found = []
    for axis in axes:
        for motion in shift_proposals(target, thin_source, reach, axis):
            pose = motion.copy()
            pose[:3, :3] = motion[:3, :3] @ expected[:3, :3]
            pose[:3, 3] += place
            found.append(Hypothesis("shift", pose))
    return found


def are_distinct(one: rigid.Pose, other: rigid.Pose) -> bool:
    """Whether two poses are two answers."""
    between = rigid.invert(one) @ other
    return bool(
        np.linalg.norm(between[:3, 3]) > DISTINCT_M or rigid.rotation_angle(between) > DISTINCT_RAD
    )


def _pose(end: Located) -> rigid.Pose:
    return end.alignment.world_from_sensor


def _distinct(tried: list[tuple[str, Alignment]]) -> list[tuple[str, Alignment]]:
    kept: list[tuple[str, Alignment]] = []
    for name, candidate in tried:
        pose = candidate.world_from_sensor
        if all(are_distinct(pose, other.world_from_sensor) for _, other in kept):
            kept.append((name, candidate))
    return kept
