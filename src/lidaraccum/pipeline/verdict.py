"""What the points say of a motion: every hypothesis is tried on all frames of the window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.landing import Lineup
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
BENDING_SAVES = 0.15
"""Turns over the window, radians, that are tried on what no straight course explains, how many of
them are refined, shares of the best that are tried then, and how much less one must cost than going
straight. None is refined where all cost more than that before, or so much more than any motion
may."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the points say of H hypotheses, (H,) each, means over points and frames.

    Attributes:
        cost: Truncated distance to the nearest partner over the gate, see `MotionSettings`.
        through: Share of points without partner in places that the frame saw through.
        shown: How much more the first hypothesis costs, where one of the two puts a point into a
            place that is hidden from the frame counted as nothing: what is seen, not what may be.
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
    said = _ask(template, velocities, frames, settings, turns)
    seen = np.where(said.hidden | said.hidden[:, :1], 0.0, said.cost[:, :1] - said.cost)
    return Verdict(
        cost=said.cost.mean(axis=(0, 2)),
        through=said.through.mean(axis=(0, 2)),
        shown=seen.mean(axis=(0, 2)),
    )


def judge_points(
    template: Template,
    velocities: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turns: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """The costs of `judge` point by point, (H, P)."""
    return np.asarray(_ask(template, velocities, frames, settings, turns).cost.mean(axis=0))


@dataclass(frozen=True, eq=False)
class _Answers:
    """What F frames say of H hypotheses on P points, (F, H, P) each.

    Attributes:
        cost: As in `Verdict`.
        through: Whether the frame saw through the place.
        hidden: Whether the place is hidden from it.
    """

    cost: NDArray[np.float64]
    through: NDArray[np.bool_]
    hidden: NDArray[np.bool_]


def _ask(
    template: Template,
    velocities: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turns: NDArray[np.float64] | None,
) -> _Answers:
    """All frames of a window but the cluster's own."""
    turns = np.zeros(len(velocities)) if turns is None else turns
    lineup = Lineup.beside(template, frames)
    local = lineup.land(template, velocities, turns)
    distance, _ = lineup.nearest(local, template.heights, settings.truncation_m)
    alone = np.isinf(distance)
    through = lineup.saw_through(local, alone)
    cost = distance / settings.truncation_m
    cost[alone] = HIDDEN_COST
    cost[through] = THROUGH_COST
    return _Answers(cost, through, alone & ~through)


def slide_velocity(
    template: Template,
    velocity: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turn: float = 0.0,
) -> NDArray[np.float64]:
    """The velocity (3,) of the same course that costs least: refining is blind to it."""
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
    if costs[1:].min() > min(float(costs[0]), settings.max_cost + BENDING_SAVES):
        return best
    tried = turns[1:][np.argsort(costs[1:], kind="stable")[:BENDS_REFINED]]
    for _ in range(2):
        starts = np.tile(best[0], (len(tried), 1))
        refined = refine_velocities(template, starts, tried, frames, settings)
        costs = judge(template, refined, frames, settings, tried).cost
        least = int(costs.argmin())
        if costs[least] < cost:
            best, cost = (refined[least], float(tried[least])), float(costs[least])
        if best[1] == 0:
            break
        tried = best[1] * np.array(FINER)
    return best


def refine_velocities(
    template: Template,
    velocities: NDArray[np.float64],
    turns: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    steps: int = REFINING_STEPS,
) -> NDArray[np.float64]:
    """Velocities (H, 3) that best take a cluster onto all other frames together, from H starts.

    ICP with one unknown for the whole window: each frame asks for a shift, its points in number
    and its distance in time are its weight. ``turns`` (H,), radians a second, stay as they are.
    """
    refined = velocities.copy()
    lineup = Lineup.beside(template, frames)
    seconds = lineup.seconds_after(template)[:, None]
    half = -0.5 * turns * seconds
    for _ in range(steps):
        hits, east, north = _asked_shifts(template, refined, turns, lineup, settings)
        weight = (hits * seconds**2).sum(axis=0)
        pull = hits * seconds
        asked = np.array(
            [
                (pull * (np.cos(half) * east - np.sin(half) * north)).sum(axis=0),
                (pull * (np.sin(half) * east + np.cos(half) * north)).sum(axis=0),
            ]
        )
        refined[:, :2] += (asked / np.where(weight > 0, weight, 1.0)).T
    return refined


def _asked_shifts(
    template: Template,
    velocities: NDArray[np.float64],
    turns: NDArray[np.float64],
    lineup: Lineup,
    settings: MotionSettings,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Points (F, H) with a partner, and the shifts east and north (F, H) they ask for, metres."""
    local = lineup.land(template, velocities, turns)
    distance, partner = lineup.nearest(local, template.heights, 2 * settings.truncation_m)
    hit = np.isfinite(distance)
    trust = np.where(hit, 1 / (0.1 + distance), 0.0)
    lag = lineup.places_of(partner) - local
    shift = (lag * trust).sum(axis=3) / np.maximum(trust.sum(axis=2), 1e-9)
    east, north, _ = lineup.in_world(shift)
    return np.count_nonzero(hit, axis=2), east, north
