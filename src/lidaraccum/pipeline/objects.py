"""Movers of one window: the points' verdict on every hypothesis; standing still wins ties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.pipeline.courses import turned
from lidaraccum.pipeline.extents import Motion
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.gathering import STANDING_MARGIN, gather, without_flanks, without_standing
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.suspects import (
    Suspect,
    Template,
    make_template,
    spread_out,
    template_of,
)
from lidaraccum.pipeline.verdict import (
    Verdict,
    bend_course,
    judge,
    refine_velocities,
    slide_velocity,
)

TEMPLATE_POINTS = 80
FIRST_LOOK_POINTS = 30
REFINED_HYPOTHESES = 2
WELL_EXPLAINED = 0.2
WORTH_A_BEND = 0.3
"""What costs less on a straight course is not asked whether it turns, nor is what saves less than
this share of the margin by it; nor is anything where a pose is doubtful: turns explain slips."""

FIRST_MARGIN = 1 / 3
REFINING_SAVES = 0.3
"""Motions are given up that after one step of refining save less than this share of the margin or
cost so much more than a motion may."""

PROBES = 5
"""So many of a longer window's frames, evenly over it, are asked for their verdict."""

FEW_POINTS = 25
FEW_COST = 0.8
"""Fewer points than this find partners by chance wherever enough places are tried: they must be
explained better, a motion may cost this share of what others' may, and are not asked for turns."""

ABOUT_M = 10.0
GOES_ALONG = 0.03
"""What stands so near to something that nobody saw through must not go along with it: not by so
much less cost than standing."""

AS_SENSOR_MPS = 0.5
AS_SENSOR_SHARE = 0.25
"""Velocities nearer than this, and this share of its speed, are the sensor's own."""

FEW_THROUGH = 0.4
"""Few points that go so are a mover if so large a share was seen through: the edge of a roof that
shows over a nearer one goes along, and is seen past."""


_NONE = np.zeros(0, dtype=np.int64)


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
        unseen: Whether too few saw through its place to tell that it moves: by its shape alone.
    """

    picked: Mapping[int, NDArray[np.int64]]
    velocity: NDArray[np.float64]
    centre: NDArray[np.float64]
    stamp: float
    margin: float
    turn: float = 0.0
    unseen: bool = False

    @property
    def size(self) -> int:
        """Its obstacles in all frames."""
        return sum(map(len, self.picked.values()))

    def of(self, frame: SightedFrame) -> NDArray[np.int64]:
        """Which of a frame's obstacles (K,) are its own."""
        return self.picked.get(frame.index, _NONE)

    def fullest(self, frames: Sequence[SightedFrame]) -> SightedFrame:
        """The frame that shows most of it."""
        return max(frames, key=lambda frame: len(self.of(frame)))

    def velocity_at(self, stamp: float) -> NDArray[np.float64]:
        """Its velocity (3,), m/s, world, at another time."""
        return turned(self.velocity, self.turn * (stamp - self.stamp))


@dataclass(frozen=True, eq=False)
class FirstLook:
    """What a suspect shows at first sight.

    Attributes:
        spread: (K,) int64: its obstacles that templates are made of, see `spread_out`.
        template: A few of them.
        standing: What standing still costs.
    """

    spread: NDArray[np.int64]
    template: Template
    standing: float


def look_at(
    suspect: Suspect, frames: Sequence[SightedFrame], settings: MotionSettings
) -> FirstLook:
    """A suspect at first sight."""
    own = frames[suspect.frame]
    spread = spread_out(own, suspect.picked)
    rough = make_template(own, spread, FIRST_LOOK_POINTS, suspect.centre)
    still = judge(rough, np.zeros((1, 3)), _probes(frames), settings)
    return FirstLook(spread, rough, float(still.cost[0]))


def explain(
    suspect: Suspect,
    proposals: NDArray[np.float64],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    turns: NDArray[np.float64] | None = None,
    first: FirstLook | None = None,
) -> WindowObject | None:
    """The suspect as a mover, or None when standing still explains its points as well.

    Args:
        suspect: Points of one frame.
        proposals: (H, 3) velocities worth trying, m/s, world.
        frames: The window.
        settings: What counts as a mover.
        turns: (H,) radians a second, worth trying with them; straight on when None.
        first: What `look_at` says of the suspect, where somebody has looked.
    """
    if len(proposals) == 0:
        return None
    first = first or look_at(suspect, frames, settings)
    if first.standing < settings.margin:
        return None
    own = frames[suspect.frame]
    turns = np.zeros(len(proposals)) if turns is None else turns
    probes, rough = _probes(frames), first.template
    cost = judge(rough, proposals, probes, settings, turns).cost
    chosen = np.argsort(cost, kind="stable")[:REFINED_HYPOTHESES]
    refined, turns = proposals[chosen], turns[chosen]
    if not _is_promising(cost.min(), first.standing, settings):
        refined = refine_velocities(rough, refined, turns, probes, settings, steps=1)
        cost = judge(rough, refined, probes, settings, turns).cost
        if not _is_promising(cost.min(), first.standing, settings):
            return None
    refined = refine_velocities(rough, refined, turns, probes, settings)
    template = make_template(own, first.spread, TEMPLATE_POINTS, suspect.centre)
    rivals = np.concatenate([np.zeros((1, 3)), refined])
    turning = np.concatenate([[0.0], turns])
    verdict = judge(template, rivals, probes, settings, turning)
    best = int(verdict.cost.argmin())
    saved = float(verdict.cost[0] - verdict.cost[best])
    if (
        turning[best] == 0
        and _are_many(suspect)
        and verdict.cost[best] > WELL_EXPLAINED
        and saved > WORTH_A_BEND * settings.margin
        and not any(frame.registered.quality.doubts for frame in frames)
    ):
        bent, turn = bend_course(template, rivals[best], probes, settings)
        if turn != 0:
            rivals, turning = np.concatenate([rivals, bent[None]]), np.append(turning, turn)
            verdict = judge(template, rivals, probes, settings, turning)
            best = int(verdict.cost.argmin())
    if not _is_motion(suspect, best, rivals, verdict, frames, settings):
        return None
    turn = float(turning[best])
    unseen = bool(verdict.through[0] <= max(settings.min_through, 0.0))
    if unseen and _all_goes_along(suspect, rivals[best], turn, frames, settings):
        return None
    velocity = slide_velocity(template, rivals[best], probes, settings, turn)
    picked = gather(suspect, velocity, frames, settings, turn)
    # Where nobody saw through, what it touches and what moves as well as it stands, stands.
    margin = -STANDING_MARGIN if unseen and settings.min_through >= 0 else STANDING_MARGIN
    picked = without_standing(picked, velocity, frames, settings, own.stamp, turn, margin)
    motion = Motion(velocity, suspect.centre, own.stamp, turn)
    return WindowObject(
        picked=without_flanks(picked, motion, frames),
        velocity=velocity,
        centre=suspect.centre,
        stamp=own.stamp,
        margin=float(verdict.cost[0] - verdict.cost[best]),
        turn=turn,
        unseen=unseen,
    )


def _all_goes_along(
    suspect: Suspect,
    velocity: NDArray[np.float64],
    turn: float,
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> bool:
    """Whether a motion suits what stands about a suspect, too: then it is a pose that is wrong.

    Nothing that others saw through is asked, so that those who go with it have no say.
    """
    own = frames[suspect.frame]
    about = own.about(suspect.centre, ABOUT_M)
    stands = (own.met[about] > 0) & (own.through[about] == 0)
    about = about[stands & ~own.in_clusters_of(suspect.picked)[about]]
    if len(about) < TEMPLATE_POINTS:
        return False
    template = template_of(own, about, TEMPLATE_POINTS)
    return saved_by(template, velocity, turn, _probes(frames), settings) > GOES_ALONG


def saved_by(
    template: Template,
    velocity: NDArray[np.float64],
    turn: float,
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> float:
    """How much less points that seem to stand cost if they go so, where nothing is hidden."""
    rivals, turns = np.stack([np.zeros(3), velocity]), np.array([0.0, turn])
    return float(judge(template, rivals, frames, settings, turns).shown[1])


def _is_promising(cost: float, standing: float, settings: MotionSettings) -> bool:
    """Whether a motion that costs so much at first sight may, refined, be one after all."""
    saved = standing - cost
    return saved > FIRST_MARGIN * settings.margin and cost < settings.max_cost + REFINING_SAVES


def _are_many(suspect: Suspect) -> bool:
    return len(suspect) >= FEW_POINTS


def _probes(frames: Sequence[SightedFrame]) -> Sequence[SightedFrame]:
    return frames[:: max(1, (len(frames) - 1) // (PROBES - 1))]


def _is_motion(
    suspect: Suspect,
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
        and verdict.cost[best] < settings.max_cost * (1.0 if _are_many(suspect) else FEW_COST)
        and verdict.cost[best] < settings.max_share * verdict.cost[0]
        and verdict.shown[best] > settings.min_shown
        and _is_accused(suspect, rivals[best], verdict, best, frames, settings)
    )


def _is_accused(
    suspect: Suspect,
    velocity: NDArray[np.float64],
    verdict: Verdict,
    best: int,
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> bool:
    """Whether enough of a suspect was seen through or, where it creeps, shown to move."""
    seen, needed = float(verdict.through[0]), settings.min_through
    if needed >= 0 and _goes_as_sensor(suspect, velocity, frames):
        return seen > (needed if _are_many(suspect) else max(needed, FEW_THROUGH))
    return seen > needed or float(verdict.shown[best]) > settings.shown


def _goes_as_sensor(
    suspect: Suspect, velocity: NDArray[np.float64], frames: Sequence[SightedFrame]
) -> bool:
    """Whether its speed is the sensor's own that way: where beams meet a rail goes along with them.

    Args:
        suspect: Points of one frame.
        velocity: (3,) m/s, world, that seems to be theirs.
        frames: The window.
    """
    before = frames[max(suspect.frame - 1, 0)]
    after = frames[min(suspect.frame + 1, len(frames) - 1)]
    seconds = after.stamp - before.stamp
    way = after.world_from_sensor[:3, 3] - before.world_from_sensor[:3, 3]
    speed = float(np.linalg.norm(velocity))
    apart_m = abs(float(way @ velocity) / speed - speed * seconds)
    return apart_m < (AS_SENSOR_MPS + AS_SENSOR_SHARE * speed) * seconds
