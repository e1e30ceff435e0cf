"""What carries the sensor and reaches beyond what is cut out about it: no mover of the map's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.objects import WindowObject

BEARINGS = 36
"""Directions about a sensor, told apart to see whether something lies all around it."""

LEAST_IN_BEARING = 0.005
"""A direction in which less than this share of something's points lie is none of its."""

LEAST_SPEED_MPS = 3.0
"""Who walks may walk close behind another; nothing drives so close behind or before the carrier."""

SAME_MPS = 0.25
ALIKE_MPS = 1.0
"""So near to the carrier's velocity is that of its own parts, and what beams that travel along two
rails say is theirs."""

ABUTS_M = 0.4
"""What begins so near to the cut about the sensor may go on within it."""

ACROSS_M = 0.3
"""What reaches so far to both sides of the sensor's way lies across it."""

FAST_MPS = 10.0
IN_WAY_M, IN_WAY, ALIKE = 1.0, 0.3, 0.1
"""Where the sensor goes faster, no such share of what drives lies so near to its way right behind
or before it: what goes alike there, but for such a share, is spray, or rain about the sensor."""


def is_carrier(one: WindowObject, frames: Sequence[SightedFrame], settings: MotionSettings) -> bool:
    """Whether a mover is what carries the sensor: all around it, or its bonnet or tail."""
    shown = [frame for frame in frames if len(one.of(frame))]
    seconds = shown[-1].stamp - shown[0].stamp
    if seconds <= 0.0:
        return False
    sensors = [rigid.transform(frame.world_from_sensor, frame.viewpoint[None]) for frame in shown]
    carried = (sensors[-1] - sensors[0])[0] / seconds
    apart = float(np.linalg.norm(one.velocity - carried))
    speed = float(np.linalg.norm(carried))
    if speed < LEAST_SPEED_MPS or apart > max(ALIKE_MPS, ALIKE * speed):
        return False
    away = [frame.world(one.of(frame)) - own for frame, own in zip(shown, sensors, strict=True)]
    around = sum(len(places) * (1 if surrounds(places) else -1) for places in away)
    if around > 0 and apart <= ALIKE_MPS:
        return True
    if not _abuts(away, settings.min_range_m):
        return False
    aside = _aside(away, carried)
    if speed > FAST_MPS and np.mean(np.abs(aside) < IN_WAY_M) > IN_WAY:
        return True
    low, high = np.quantile(aside, (0.05, 0.95))
    return bool(apart < SAME_MPS and low < -ACROSS_M and high > ACROSS_M)


def surrounds(places: NDArray[np.float64]) -> bool:
    """Whether places (N, 3) about the sensor lie in more than half of all directions.

    Seen from outside, no body takes up half of the way around: what does holds the sensor, and is
    what carries it.
    """
    bearing = np.arctan2(places[:, 1], places[:, 0])
    counts, _ = np.histogram(bearing, BEARINGS, (-np.pi, np.pi))
    taken = np.flatnonzero(counts > LEAST_IN_BEARING * len(places))
    gaps = np.diff(np.append(taken, taken[:1] + BEARINGS))
    return bool(gaps.max(initial=0) < BEARINGS // 2)


def _abuts(away: Sequence[NDArray[np.float64]], cut_m: float) -> bool:
    """Whether places (N, 3) about the sensor, by frame, begin at the cut about it."""
    nearest = np.median([np.linalg.norm(places, axis=1).min() for places in away])
    return bool(nearest < cut_m + ABUTS_M)


def _aside(
    away: Sequence[NDArray[np.float64]], carried: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(M,) metres to the left of the sensor's way, of places (N, 3) about it, by frame."""
    left = np.array([-carried[1], carried[0]]) / np.linalg.norm(carried[:2])
    aside: NDArray[np.float64] = np.concatenate(away)[:, :2] @ left
    return aside
