"""Movers of one window: the points' verdict on every hypothesis; standing still wins ties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.geometry.clustering import connected_cells
from lidaraccum.geometry.voxel import thin
from lidaraccum.pipeline.courses import are_alike, carried, turned
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.suspects import Suspect, Template, make_template
from lidaraccum.pipeline.verdict import (
    Verdict,
    as_met,
    bend_course,
    judge,
    judge_points,
    refine_velocity,
    slide_velocity,
)

TEMPLATE_POINTS = 80
FIRST_LOOK_POINTS = 30
REFINED_HYPOTHESES = 2
WELL_EXPLAINED = 0.2
"""What costs less on a straight course is not asked whether it turns."""

PROBES = 5
"""So many of a longer window's frames, evenly over it, are asked for their verdict."""

JOIN_M = 0.4
WHOLE_SHARE = 0.5
WHOLE_GROWTH = 2.5
"""A frame's points this near to the moved cluster are its points; so is all of a cluster of which
they are more than this share, unless it has so many times the points."""

GATHERINGS = 3
MOST_GROWTH = 8.0
"""What has so many times the points at one distance is something else: a wall that was touched."""

STANDING_SHARE = 0.1
STANDING_MARGIN = 0.1
"""With more than this share of points that were met and never seen through, each is asked whether
standing costs it so much less than moving."""

SAME_GAP_M = 0.8
SAME_SPEED_MPS = 0.8
"""Two movers nearer than this and with velocities as like as this are one."""

LIKE_SPEED_MPS = 2.0
LIKE_SPEED_SHARE = 0.3
NO_WORSE = 0.05
"""So are two whose velocities differ by less than this and this share of the speed, where one of
the motions costs the other's points at most so much more than their own: the long side of a truck
fits many velocities, its ends one."""


@dataclass(frozen=True, eq=False)
class Expectation:
    """A mover of earlier windows.

    Attributes:
        centre: (3,) metres, world, at ``stamp``.
        velocity: (3,) m/s, world.
        stamp: Seconds.
    """

    centre: NDArray[np.float64]
    velocity: NDArray[np.float64]
    stamp: float

    def centre_at(self, stamp: float) -> NDArray[np.float64]:
        """Where (3,) its centre must be at another time."""
        return self.centre + self.velocity * (stamp - self.stamp)


@dataclass(frozen=True, eq=False)
class WindowObject:
    """A mover of one window.

    Attributes:
        picked: By frame index in the sequence: which of that frame's obstacles (K,).
        velocity: (3,) m/s, world, at ``stamp``.
        centre: (3,) metres, world, of its points in the frame at ``stamp``.
        stamp: Seconds.
        margin: How much cheaper this motion is than standing still.
        turn: Radians a second, of it and of its velocity.
    """

    picked: Mapping[int, NDArray[np.int64]]
    velocity: NDArray[np.float64]
    centre: NDArray[np.float64]
    stamp: float
    margin: float
    turn: float = 0.0


def explain(
    suspect: Suspect,
    proposals: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turns: NDArray[np.float64] | None = None,
) -> WindowObject | None:
    """The suspect as a mover, or None when standing still explains its points as well.

    Args:
        suspect: Points of one frame.
        proposals: (H, 3) velocities worth trying, m/s, world.
        frames: The window.
        settings: What counts as a mover.
        turns: (H,) radians a second, worth trying with them; straight on when None.
    """
    own = frames[suspect.frame]
    turns = np.zeros(len(proposals)) if turns is None else turns
    still = np.zeros((1, 3))
    probes = frames[:: max(1, (len(frames) - 1) // (PROBES - 1))]
    rough = make_template(own, suspect.picked, FIRST_LOOK_POINTS)
    if len(proposals) == 0 or judge(rough, still, probes, settings).cost[0] < settings.margin:
        return None
    order = np.argsort(judge(rough, proposals, probes, settings, turns).cost, kind="stable")
    template = make_template(own, suspect.picked, TEMPLATE_POINTS)
    chosen = order[:REFINED_HYPOTHESES]
    refined = [
        refine_velocity(rough, proposals[choice], probes, settings, float(turns[choice]))
        for choice in chosen
    ]
    rivals = np.concatenate([still, refined])
    turning = np.concatenate([[0.0], turns[chosen]])
    verdict = judge(template, rivals, probes, settings, turning)
    best = int(verdict.cost.argmin())
    if best > 0 and turning[best] == 0 and verdict.cost[best] > WELL_EXPLAINED:
        bent, turn = bend_course(template, rivals[best], probes, settings)
        rivals, turning = np.concatenate([rivals, bent[None]]), np.append(turning, turn)
        verdict = judge(template, rivals, probes, settings, turning)
        best = int(verdict.cost.argmin())
    if not _is_motion(best, rivals, verdict, frames, settings):
        return None
    turn = float(turning[best])
    velocity = slide_velocity(template, rivals[best], probes, settings, turn)
    picked = gather(suspect, velocity, frames, settings, turn)
    return WindowObject(
        picked=without_standing(picked, velocity, frames, settings, own.stamp, turn),
        velocity=velocity,
        centre=suspect.centre,
        stamp=own.stamp,
        margin=float(verdict.cost[0] - verdict.cost[best]),
        turn=turn,
    )


def _is_motion(
    best: int,
    rivals: NDArray[np.float64],
    verdict: Verdict,
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> bool:
    speed = float(np.linalg.norm(rivals[best]))
    way = speed * (frames[-1].stamp - frames[0].stamp)
    return (
        settings.min_speed_mps < speed < settings.max_speed_mps
        and way > settings.min_shift_m
        and verdict.cost[0] - verdict.cost[best] > settings.margin
        and verdict.cost[best] < settings.max_cost
        and verdict.cost[best] < settings.max_share * verdict.cost[0]
        and verdict.through[0] > settings.min_through
    )


def gather(
    suspect: Suspect,
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turn: float = 0.0,
) -> dict[int, NDArray[np.int64]]:
    """By frame index: the obstacles (K,) of each frame that the moved suspect lies on.

    A suspect may be no more than the end of a truck that was seen through. So what the fullest
    frame shows of it is moved to all others in turn, as long as another becomes the fullest; but
    not what stands or hides there, and then only clusters that are its as a whole are added: a
    wall it touches goes on and on.
    """
    source = frames[suspect.frame]
    gathered = {source.index: suspect.picked}
    for number in range(GATHERINGS):
        there = turned(velocity, turn * (source.stamp - frames[suspect.frame].stamp))
        picked = gathered[source.index]
        if number:
            own = without_standing(
                {source.index: picked}, there, frames, settings, source.stamp, turn
            )
            picked = _accused_parts(own.get(source.index, picked[:0]), source, settings)
        if len(picked) == 0:
            break
        found = _lain_on(source, picked, there, frames, turn, whole_only=number > 0)
        for index, more in found.items():
            known = gathered.get(index)
            gathered[index] = more if known is None else np.union1d(known, more)
        fullest = max(frames, key=lambda frame: len(gathered.get(frame.index, ())))
        if fullest is source:
            break
        source = fullest
    return gathered


def _accused_parts(
    picked: NDArray[np.int64], frame: SightedFrame, settings: MotionSettings
) -> NDArray[np.int64]:
    """The picked obstacles (K,) in parts that others saw through; not what nobody could see."""
    part = connected_cells(frame.points[picked], settings.cell_m)
    share = np.bincount(part, frame.through[picked] > 0) / np.maximum(np.bincount(part), 1)
    return picked[share[part] >= settings.seed_share]


def _lain_on(
    own: SightedFrame,
    picked: NDArray[np.int64],
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    turn: float,
    *,
    whole_only: bool,
) -> dict[int, NDArray[np.int64]]:
    """By frame index: the obstacles (K,) of other frames that some of this one's, moved, lie on."""
    world, heights = own.world(picked), own.heights[picked]
    gathered = {}
    for frame in frames:
        if frame is own:
            continue
        seconds = frame.stamp - own.stamp
        moved = carried(world, world.mean(axis=0), velocity, turn, seconds)
        local = as_met(moved, velocity, own.seconds[picked], frame)
        found = _points_at(frame, frame.places(local, heights), whole_only=whole_only)
        nearer = max(1.0, _mean_range(own.points[picked]) / max(_mean_range(local), 0.1))
        if 0 < len(found) < MOST_GROWTH * len(picked) * nearer**2:
            gathered[frame.index] = found
    return gathered


def _mean_range(points: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(points, axis=1).mean())


def _points_at(
    frame: SightedFrame, places: NDArray[np.float64], *, whole_only: bool
) -> NDArray[np.int64]:
    x, y = frame.level
    low, high = places.min(axis=0) - JOIN_M, places.max(axis=0) + JOIN_M
    about = np.flatnonzero((x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]))
    if len(about) == 0:
        return about
    own = frame.places(frame.points[about], frame.heights[about])
    distance, _ = cKDTree(places).query(own, distance_upper_bound=JOIN_M)
    close = about[np.isfinite(distance)]
    sizes = frame.segment_sizes
    shares = np.bincount(frame.segments[close], minlength=len(sizes)) / sizes
    whole = (shares > WHOLE_SHARE) & (sizes < WHOLE_GROWTH * len(places))
    keep = whole[frame.segments]
    if not whole_only:
        keep[close] = True
    return np.flatnonzero(keep)


def without_standing(
    picked: Mapping[int, NDArray[np.int64]],
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    stamp: float,
    turn: float = 0.0,
) -> dict[int, NDArray[np.int64]]:
    """The mover's points less what stands and only touches it (a parked car it passes).

    Its velocity (3,) is that at ``stamp``, its rate of turn in radians a second.
    """
    kept = {}
    for frame in frames:
        if frame.index not in picked:
            continue
        mine = picked[frame.index]
        doubtful = mine[(frame.through[mine] == 0) & (frame.met[mine] > 0)]
        if len(doubtful) > STANDING_SHARE * len(mine):
            sample = doubtful[thin(frame.points[doubtful], 0.2)]
            world = frame.world(sample)
            template = Template(
                world, frame.heights[sample], frame.stamp, frame.seconds[sample], world.mean(axis=0)
            )
            rivals = np.stack([np.zeros(3), turned(velocity, turn * (frame.stamp - stamp))])
            cost, _ = judge_points(template, rivals, frames, settings, np.array([0.0, turn]))
            stands = cost[0] + STANDING_MARGIN < cost[1]
            _, nearest = cKDTree(frame.points[sample]).query(frame.points[doubtful])
            mine = np.setdiff1d(mine, doubtful[stands[nearest]])
        if len(mine):
            kept[frame.index] = mine
    return kept


def join_parts(
    objects: Sequence[WindowObject], frames: Sequence[SightedFrame], settings: MotionSettings
) -> list[WindowObject]:
    """Movers that touch and move alike, or as well, made one.

    The largest part's motion stands for all, unless only a smaller one's explains both.
    """
    joined: list[WindowObject] = []
    for part in objects:
        for place, whole in enumerate(joined):
            united = _united_if_one(part, whole, frames, settings)
            if united is not None:
                joined[place] = united
                break
        else:
            joined.append(part)
    return joined


def _united_if_one(
    part: WindowObject,
    whole: WindowObject,
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> WindowObject | None:
    velocities = whole.velocity, part.velocity
    if not are_alike(*velocities, LIKE_SPEED_MPS, LIKE_SPEED_SHARE):
        return None
    if not _touch(part, whole, frames):
        return None
    if are_alike(*velocities, SAME_SPEED_MPS, 0.0) or _goes_with(part, whole, frames, settings):
        return _united(whole, part)
    return _united(part, whole) if _goes_with(whole, part, frames, settings) else None


def _goes_with(
    one: WindowObject, other: WindowObject, frames: Sequence[SightedFrame], settings: MotionSettings
) -> bool:
    """Whether another's motion explains a mover's points as well as its own."""
    own = max(frames, key=lambda frame: len(one.picked.get(frame.index, ())))
    template = make_template(own, one.picked[own.index], TEMPLATE_POINTS)
    velocities = [
        turned(mover.velocity, mover.turn * (own.stamp - mover.stamp)) for mover in (one, other)
    ]
    turns = np.array([one.turn, other.turn])
    cost = judge(template, np.stack(velocities), frames, settings, turns).cost
    return bool(cost[1] < cost[0] + NO_WORSE)


def _touch(part: WindowObject, whole: WindowObject, frames: Sequence[SightedFrame]) -> bool:
    for frame in frames:
        if frame.index in part.picked and frame.index in whole.picked:
            body = cKDTree(frame.points[whole.picked[frame.index]])
            distance, _ = body.query(frame.points[part.picked[frame.index]])
            if distance.min() < SAME_GAP_M:
                return True
    return False


def _united(whole: WindowObject, part: WindowObject) -> WindowObject:
    picked = dict(whole.picked)
    for index, rows in part.picked.items():
        picked[index] = np.union1d(picked[index], rows) if index in picked else rows
    return replace(whole, picked=picked)
