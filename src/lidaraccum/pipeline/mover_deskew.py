"""Undoing each mover's own motion within a sweep, as registration undoes the sensor's."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.geometry import rigid
from lidaraccum.registration.deskew import transform_along

MAX_APART_S = 1.0
"""Frames farther apart say little of how a thing moves at one of them."""

MIN_ELAPSED = 0.5
"""A mover that passed the sweep's seam may be seen twice in a row at nearly one time, which tells
no speed: so much of the time between two stamps must lie between its sightings."""

MAX_TURN = np.pi / 2
"""Radians a second; what seems to turn faster was fitted, or its box drawn, the wrong way round."""


@dataclass(frozen=True, eq=False)
class _Sighting:
    """A mover in one frame.

    Attributes:
        world_from_object: (4, 4) its pose.
        rows: (K,) its points in the frame.
        stamp: Of the frame, seconds.
        lag_s: How long after the stamp the pose holds.
    """

    world_from_object: rigid.Pose
    rows: NDArray[np.intp]
    stamp: float
    lag_s: float


_Sightings = dict[int, _Sighting]
_Sighted = tuple[PerceivedFrame, _Sightings]


def undo_own_motion(
    frames: Iterable[PerceivedFrame], max_speed_mps: float
) -> Iterator[PerceivedFrame]:
    """Take each mover's points to where they were at their frame's stamp.

    A mover's motion is that from the frame before to the one after (to or from this one where only
    one of them knows it), a constant twist, as the sensor's is. A mover that neither knows, or that
    seems too fast, stays as it is, as does a frame without a time per point. One frame ahead is
    looked at.

    Args:
        frames: In order; the sensor's motion within the sweep is undone.
        max_speed_mps: Faster motions are not believed.

    Yields:
        The same frames. Poses of movers whose motion was undone are those at the stamp.
    """
    sighted: Iterator[_Sighted] = ((frame, _sightings(frame)) for frame in frames)
    none: _Sightings = {}
    before = none
    for now, after in pairwise(chain(sighted, [None])):
        assert now is not None, "only the last is None"
        yield _undone(now, before, none if after is None else after[1], max_speed_mps)
        before = now[1]


def _sightings(perceived: PerceivedFrame) -> _Sightings:
    seconds = perceived.registered.seconds_from_stamp
    found: _Sightings = {}
    for instance, pose in perceived.world_from_object.items():
        rows = np.flatnonzero(perceived.instance == instance)
        fitted = seconds is not None and len(rows) and not perceived.poses_at_stamp
        # A pose fitted to points as they lie is that of the time at which the sweep passed them.
        lag_s = float(seconds[rows].mean()) if seconds is not None and fitted else 0.0
        found[instance] = _Sighting(pose, rows, perceived.registered.frame.stamp, lag_s)
    return found


def _undone(
    sighted: _Sighted, before: _Sightings, after: _Sightings, max_speed_mps: float
) -> PerceivedFrame:
    perceived, sightings = sighted
    registered = perceived.registered
    seconds = registered.seconds_within_sweep
    if seconds is None or not sightings:
        return perceived
    points = registered.frame.points.copy()
    poses = dict(perceived.world_from_object)
    for instance, now in sightings.items():
        rate = _rate(before.get(instance, now), now, after.get(instance, now))
        if rate is None or len(now.rows) == 0:
            continue
        object_from_sensor = rigid.invert(now.world_from_object) @ registered.world_from_sensor
        own = rigid.transform(object_from_sensor, points[now.rows])
        if np.linalg.norm(rigid.crossed(rate[:3], own.mean(axis=0)) + rate[3:]) > max_speed_mps:
            continue
        own = transform_along(-rate, seconds[now.rows], own)
        points[now.rows] = rigid.transform(rigid.invert(object_from_sensor), own)
        poses[instance] = now.world_from_object @ rigid.exponential(-rate * now.lag_s)
    return replace(
        perceived,
        registered=replace(registered, frame=registered.frame.with_points(points)),
        world_from_object=poses,
    )


def _rate(first: _Sighting, now: _Sighting, last: _Sighting) -> NDArray[np.float64] | None:
    """The twist (6,) per second, the object's own axes, between two sightings about this one.

    None where they tell no speed. The first or the last may be this one.
    """
    first = first if now.stamp - first.stamp <= MAX_APART_S else now
    last = last if last.stamp - now.stamp <= MAX_APART_S else now
    elapsed = last.stamp + last.lag_s - first.stamp - first.lag_s
    if not elapsed > MIN_ELAPSED * (last.stamp - first.stamp) or last.stamp <= first.stamp:
        return None
    motion = rigid.invert(first.world_from_object) @ last.world_from_object
    if rigid.rotation_angle(motion) > MAX_TURN * elapsed:
        return None
    return rigid.logarithm(motion) / elapsed
