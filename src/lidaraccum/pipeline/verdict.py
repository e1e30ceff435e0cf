"""What the points say of a motion: every hypothesis is tried on all frames of the window."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.geometry import rigid
from lidaraccum.pipeline.courses import carried, turned
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.suspects import Template

HIDDEN_COST = 0.7
THROUGH_COST = 1.5
"""A point without a partner costs less than one at the gate's edge where it may be hidden, and
more where the frame saw through its place."""

REFINING_STEPS = 3

SLIDES = 8
WORTH_SLIDING = 0.01
"""So many faster and slower velocities are tried, a gate's width apart at the window's end; one is
taken that costs so much less. The long side of a truck finds partners wherever it slides to."""

BENDS = (0.1, 0.2, 0.4, 0.8, -0.1, -0.2, -0.4, -0.8)
BENDS_REFINED = 2
FINER = (0.75, 1.25)
WORTH_BENDING = 0.05
"""Turns over the window, radians, that are tried on what no straight course explains, how many of
them are refined, shares of the best that are tried then, and how much less one must cost than going
straight."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the points say of H hypotheses, (H,) each, means over points and frames.

    Attributes:
        cost: Truncated distance to the nearest partner over the gate, see `MotionSettings`.
        through: Share of points without partner in places that the frame saw through.
        shown: How much more the first hypothesis costs, summed where neither puts a point into a
            place that is hidden from the frame: what is seen of it, not what may be.
    """

    cost: NDArray[np.float64]
    through: NDArray[np.float64]
    shown: NDArray[np.float64]


def judge(
    template: Template,
    velocities: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turns: NDArray[np.float64] | None = None,
) -> Verdict:
    """Try velocities (H, 3), m/s, world, on a cluster, in all other frames of its window.

    ``turns`` (H,), radians a second, are tried with them; straight on when None.
    """
    total, passed, shown = np.zeros((3, len(velocities)))
    others = 0
    for cost, through, hidden in _by_frame(template, velocities, frames, settings, turns):
        total += cost.mean(axis=1)
        passed += through.mean(axis=1)
        shown += np.where(hidden | hidden[0], 0.0, cost[0] - cost).mean(axis=1)
        others += 1
    return Verdict(cost=total / others, through=passed / others, shown=shown / others)


def judge_points(
    template: Template,
    velocities: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turns: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """As `judge`, point by point: costs (H, P) and shares of frames that saw through (H, P)."""
    said = list(_by_frame(template, velocities, frames, settings, turns))
    costs, passed, _ = (np.mean(part, axis=0) for part in zip(*said, strict=True))
    return costs, passed


def _by_frame(
    template: Template,
    velocities: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turns: NDArray[np.float64] | None,
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]]:
    """What each other frame says: costs, what it saw through, what is hidden from it, (H, P)."""
    hypotheses, count = len(velocities), len(template.world)
    turns = np.zeros(hypotheses) if turns is None else turns
    heights = np.tile(template.heights, hypotheses)
    for frame in frames:
        seconds = frame.stamp - template.stamp
        if seconds == 0:
            continue
        moved = template.world[None] + velocities[:, None] * seconds
        for row in np.flatnonzero(turns):
            turn = float(turns[row])
            moved[row] = carried(template.world, template.pivot, velocities[row], turn, seconds)
        local = as_met(moved, velocities[:, None], template.seconds, frame).reshape(-1, 3)
        gate = settings.truncation_m
        distance, _ = frame.tree.query(frame.places(local, heights), distance_upper_bound=gate)
        alone = np.isinf(distance)
        through = alone.copy()
        through[through] = frame.view.look(local[through]).through
        cost = np.where(through, THROUGH_COST, np.where(alone, HIDDEN_COST, distance / gate))
        said = cost, through, alone & ~through
        yield tuple(part.reshape(hypotheses, count) for part in said)


def slide_velocity(
    template: Template,
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turn: float = 0.0,
) -> NDArray[np.float64]:
    """The velocity (3,) of the same course that costs least: what `refine_velocity` is blind to."""
    span = max(abs(frame.stamp - template.stamp) for frame in frames)
    speed = float(np.linalg.norm(velocity))
    if speed == 0 or span == 0:
        return velocity
    step = velocity / speed * (settings.truncation_m / span)
    tried = velocity + np.arange(-SLIDES, SLIDES + 1)[:, None] * step
    cost = judge(template, tried, frames, settings, np.full(len(tried), turn)).cost
    best = int(cost.argmin())
    if cost[SLIDES] - cost[best] < WORTH_SLIDING:
        return velocity
    if 0 < best < len(tried) - 1:  # the vertex of the parabola through the three
        before, least, after = cost[best - 1 : best + 2]
        bend = before - 2 * least + after
        if bend > 0:
            return np.asarray(tried[best] + 0.5 * (before - after) / bend * step)
    return np.asarray(tried[best])


def bend_course(
    template: Template,
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> tuple[NDArray[np.float64], float]:
    """The velocity (3,) and rate of turn, radians a second, that cost least, from a straight start.

    Straight on unless some turn explains the points clearly better: going straight wins ties.
    """
    stamps = [frame.stamp for frame in frames]
    turns = np.array((0.0, *BENDS)) / max(max(stamps) - min(stamps), 1e-6)
    costs = judge(template, np.tile(velocity, (len(turns), 1)), frames, settings, turns).cost
    best, cost = (velocity, 0.0), float(costs[0]) - WORTH_BENDING
    promising = turns[1:][np.argsort(costs[1:], kind="stable")[:BENDS_REFINED]]
    for finer in (False, True):
        start, about = best
        if finer and about == 0:
            break
        for turn in (about * np.array(FINER) if finer else promising).tolist():
            refined = refine_velocity(template, start, frames, settings, turn)
            its_cost = _cost(template, refined, turn, frames, settings)
            if its_cost < cost:
                best, cost = (refined, turn), its_cost
    return best


def _cost(
    template: Template,
    velocity: NDArray[np.float64],
    turn: float,
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> float:
    return float(judge(template, velocity[None], frames, settings, np.array([turn])).cost[0])


def as_met(
    moved: NDArray[np.float64],
    velocity: NDArray[np.float64],
    seconds: NDArray[np.float64],
    frame: SightedFrame,
) -> NDArray[np.float64]:
    """Where a frame meets points of a mover: a sweep takes time, and the mover goes on meanwhile.

    Args:
        moved: (..., N, 3) metres, world: the points, moved from stamp to stamp.
        velocity: (..., 1, 3) or (3,) m/s, world.
        seconds: (N,) after its own frame's stamp, when each was met.
        frame: Who meets them.

    Returns:
        (..., N, 3) metres, sensor coordinates.
    """
    local = rigid.transform(frame.sensor_from_world, moved.reshape(-1, 3)).reshape(moved.shape)
    if not frame.is_timed:
        return local
    later = frame.seconds_at(local.reshape(-1, 3)).reshape(moved.shape[:-1]) - seconds
    return np.asarray(local + later[..., None] * (velocity @ frame.sensor_from_world[:3, :3].T))


def refine_velocity(
    template: Template,
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turn: float = 0.0,
) -> NDArray[np.float64]:
    """The velocity (3,) that best takes a cluster onto all other frames together, from a start.

    ICP with one unknown for the whole window: each frame asks for a shift, its points in number
    and its distance in time are its weight. ``turn``, radians a second, stays as it is.
    """
    refined = velocity.copy()
    for _ in range(REFINING_STEPS):
        asked, weight = np.zeros(3), 0.0
        for frame in frames:
            seconds = frame.stamp - template.stamp
            if seconds == 0:
                continue
            moved = carried(template.world, template.pivot, refined, turn, seconds)
            local = as_met(moved, refined, template.seconds, frame)
            distance, partner = frame.tree.query(
                frame.places(local, template.heights),
                distance_upper_bound=2 * settings.truncation_m,
            )
            hit = np.isfinite(distance)
            if not hit.any():
                continue
            trust = 1 / (0.1 + distance[hit])
            lag = (frame.near_points[partner[hit]] - local[hit]) * trust[:, None]
            shift = frame.world_from_sensor[:3, :3] @ (lag.sum(axis=0) / trust.sum())
            asked += hit.sum() * seconds * turned(shift, -0.5 * turn * seconds)
            weight += hit.sum() * seconds**2
        if weight == 0:
            break
        refined[:2] += asked[:2] / weight
    return refined
