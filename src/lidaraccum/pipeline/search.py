"""Movers of one window: what free space accuses and what a proposer points out, each verified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.pipeline.advice import Leads, no_leads
from lidaraccum.pipeline.carrier import is_carrier
from lidaraccum.pipeline.courses import are_alike, way
from lidaraccum.pipeline.extents import Motion, is_vehicle_sized
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.gathering import MOST_GROWTH, WHOLE_GROWTH
from lidaraccum.pipeline.hypotheses import propose
from lidaraccum.pipeline.joining import complete, join_parts
from lidaraccum.pipeline.motion_settings import LIKELY, MotionSettings
from lidaraccum.pipeline.objects import Expectation, FirstLook, WindowObject, explain, look_at
from lidaraccum.pipeline.strips import with_middle, without_walls
from lidaraccum.pipeline.suspects import (
    Lead,
    Suspect,
    find_suspects,
    spread_out,
    whole_template,
)
from lidaraccum.pipeline.verdict import judge_points

EXPECTED_M = 1.5
"""A suspect this near to where a mover must be by now may be it."""

CLAIMED_SHARE = 0.3
"""A suspect with more than this share of points that are a mover's is part of it."""

KNOWN_SHARE = 0.8
"""A proposed mover with more than this share of points that are a mover's is known."""

OUTLINE_SHARE = 0.6
"""A proposer's outline is a mover's where it holds more than this share of its points."""

WHOLE_SHARE = 0.85
BETTER_SHARE = 0.7
"""A proposed mover stands for others that it overlaps and that move like it if it has at least the
first share of their points, for others that move otherwise if it saves the second share of what
they do, on the points of all; else it is but a part of them, or wrong."""

SURE_SHARE = 0.85
"""As much must one save whose proposer is sure, on less evidence."""

COMPARED_POINTS = 160
"""So many points of a frame at most are asked whose motion saves more."""

ALIKE_MPS = 0.8
ALIKE_SHARE = 0.1
"""Velocities nearer than this, and this share of the speed, are alike."""

_NONE = np.zeros(0, dtype=np.int64)


def find_objects(
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    expected: Sequence[Expectation] = (),
    leads: Leads = no_leads,
) -> list[WindowObject]:
    """The movers of a window whose frames have watched one another.

    Args:
        frames: In order.
        settings: What counts as a mover.
        expected: Movers of earlier windows: their motions are tried first, and nothing else is
            where they explain the points.
        leads: Tells of proposed movers, once free space has been asked. They must show as much as
            any other; those whose proposer is sure are asked once more, last, on less evidence.
    """
    suspects = find_suspects(frames, settings)
    free = _accused(suspects, frames, settings, expected)
    proposed = _Claimed(frames)
    looked = [(lead, look_at(lead.suspect, frames, settings)) for lead in leads()]
    for lead, first in looked:
        if proposed.share(lead.suspect) <= CLAIMED_SHARE:
            found = _explain_lead(lead, frames, settings, expected, first)
            proposed.add(_outlined(found, lead, frames) if found else None)
    movers = _settle(proposed.objects, free, frames, settings, BETTER_SHARE)
    for lead, first in looked:
        if lead.trust >= LIKELY and _Claimed(frames, movers).share(lead.suspect) <= KNOWN_SHARE:
            trusting = settings.trusting(lead.trust)
            found = _explain_lead(lead, frames, trusting, expected, first)
            if found is None:  # its proposer may be right that it moves and wrong how
                proposals = propose(lead.suspect, suspects, frames, settings)
                found = explain(lead.suspect, proposals, frames, trusting, first=first)
                if found is not None and found.margin < settings.margin:
                    found = found if _is_vehicle_sized(found, frames) else None
            if found is not None:
                # What the points are sure of is more than its proposer's outline.
                is_sure = found.margin > settings.sure_margin and not found.unseen
                meant = (_outlined if is_sure else _meant)(found, lead, frames)
                movers = _settle([meant], movers, frames, settings, SURE_SHARE)
    sure = [lead for lead, _ in looked if lead.trust >= LIKELY]
    # Before parts are joined too: what keeps pace with the carrier would go with it.
    others = _without_carrier(movers, frames, settings)
    whole = complete(join_parts(others, frames, settings), sure, frames, settings)
    return [_filled(one, frames) for one in _without_carrier(whole, frames, settings)]


def _is_vehicle_sized(found: WindowObject, frames: Sequence[SightedFrame]) -> bool:
    """Whether a mover is no more than a vehicle in the frame that shows most of it."""
    fullest = max(frames, key=lambda frame: len(found.of(frame)))
    return is_vehicle_sized(fullest.world(found.of(fullest)), found.velocity_at(fullest.stamp))


def _without_carrier(
    movers: Sequence[WindowObject], frames: Sequence[SightedFrame], settings: MotionSettings
) -> list[WindowObject]:
    return [one for one in movers if not is_carrier(one, frames, settings)]


def _filled(one: WindowObject, frames: Sequence[SightedFrame]) -> WindowObject:
    most_growth = WHOLE_GROWTH if one.unseen else MOST_GROWTH
    motion = Motion(one.velocity, one.centre, one.stamp, one.turn)
    own = without_walls(one.picked, motion, frames)
    picked = with_middle(own, motion, frames, most_growth)
    return replace(one, picked=picked)


def _accused(
    suspects: Sequence[Suspect],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    expected: Sequence[Expectation],
) -> list[WindowObject]:
    """The movers that free space raises suspicion of; those it says least of come last."""
    claimed = _Claimed(frames)
    unseen: list[tuple[Suspect, WindowObject]] = []
    for suspect in suspects:
        if claimed.share(suspect) > CLAIMED_SHARE:
            continue
        first = look_at(suspect, frames, settings)
        if first.standing < settings.margin:
            continue
        known = _expected_velocities(suspect, frames[suspect.frame].stamp, expected)
        found = explain(suspect, known, frames, settings, first=first)
        if found is None:
            proposals = propose(suspect, suspects, frames, settings)
            found = explain(suspect, proposals, frames, settings, first=first)
        if found is not None and found.unseen:
            unseen.append((suspect, found))
        else:
            claimed.add(found)
    for suspect, found in unseen:
        if claimed.share(suspect) <= CLAIMED_SHARE:
            claimed.add(found)
    return claimed.objects


def _settle(
    proposed: Sequence[WindowObject],
    others: Sequence[WindowObject],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    share: float,
) -> list[WindowObject]:
    """Movers without those that overlap: a proposed one, or those it overlaps.

    Args:
        proposed: Movers by a proposer's word.
        others: Movers known already.
        frames: The window.
        settings: What costs are measured by.
        share: Of what others save by another motion, a proposed one saves so much.
    """
    kept, left = [], list(others)
    for one in proposed:
        rivals = [other for other in left if _overlap(one, other)]
        if _stands_for(one, rivals, frames, settings, share):
            kept.append(_with_accused(one, rivals, frames))
            left = [other for other in left if not any(other is rival for rival in rivals)]
    return sorted(kept + left, key=lambda one: -max(map(len, one.picked.values()), default=0))


def _stands_for(
    one: WindowObject,
    rivals: Sequence[WindowObject],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    share: float,
) -> bool:
    """Whether a proposed mover is better than those it overlaps: its parts, or something else."""
    if all(_moves_alike(one, rival) for rival in rivals):
        return one.size >= WHOLE_SHARE * sum(rival.size for rival in rivals)
    mine, theirs = _savings(one, rivals, frames, settings)
    return mine >= share * theirs


def _savings(
    one: WindowObject,
    rivals: Sequence[WindowObject],
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
) -> tuple[float, float]:
    """How much less points cost than standing if only a mover moves, and if only its rivals do.

    On the points of all of them, in the frame that shows most of both sides.
    """
    theirs = {frame.index: sum(len(rival.of(frame)) for rival in rivals) for frame in frames}
    frame = max(frames, key=lambda frame: min(len(one.of(frame)), theirs[frame.index]))
    everything = np.unique(np.concatenate([mover.of(frame) for mover in (one, *rivals)]))
    spread = spread_out(frame, everything)
    asked = spread[:: len(spread) // COMPARED_POINTS + 1]
    template = whole_template(frame, asked)

    def cost(velocity: NDArray[np.float64], turn: float, pivot: NDArray[np.float64]) -> Any:
        about = replace(template, pivot=pivot)
        return judge_points(about, velocity[None], frames, settings, np.array([turn]))[0]

    def saved(movers: Sequence[WindowObject]) -> float:
        moved = standing.copy()
        for mover in movers:
            seconds = frame.stamp - mover.stamp
            centre = mover.centre + way(mover.velocity, mover.turn, seconds)
            own = np.isin(asked, mover.of(frame))
            moved[own] = cost(mover.velocity_at(frame.stamp), mover.turn, centre)[own]
        return float((standing - moved).mean())

    standing = cost(np.zeros(3), 0.0, template.pivot)
    return saved([one]), saved(rivals)


def _with_accused(
    one: WindowObject, rivals: Sequence[WindowObject], frames: Sequence[SightedFrame]
) -> WindowObject:
    """A proposed mover and what is seen through of those that it stands for."""
    picked = dict(one.picked)
    for frame in frames:
        for rival in rivals:
            theirs = rival.of(frame)
            accused = theirs[frame.through[theirs] > frame.met[theirs]]
            if len(accused):
                picked[frame.index] = np.union1d(picked.get(frame.index, _NONE), accused)
    return replace(one, picked=picked)


def _moves_alike(one: WindowObject, other: WindowObject) -> bool:
    return are_alike(one.velocity, other.velocity, ALIKE_MPS, ALIKE_SHARE)


def _overlap(one: WindowObject, other: WindowObject) -> bool:
    return any(
        len(np.intersect1d(picked, other.picked[index], assume_unique=True))
        > CLAIMED_SHARE * min(len(picked), len(other.picked[index]))
        for index, picked in one.picked.items()
        if index in other.picked
    )


def _explain_lead(
    lead: Lead,
    frames: Sequence[SightedFrame],
    settings: MotionSettings,
    expected: Sequence[Expectation],
    first: FirstLook,
) -> WindowObject | None:
    known = _expected_velocities(lead.suspect, frames[lead.suspect.frame].stamp, expected)
    proposals = np.concatenate([known, lead.velocities])
    turns = np.concatenate([np.zeros(len(known)), lead.turns])
    return explain(lead.suspect, proposals, frames, settings, turns, first)


def _outlined(found: WindowObject, lead: Lead, frames: Sequence[SightedFrame]) -> WindowObject:
    """The mover within its proposer's outline, where that holds most of what moves with it."""
    meant = _meant(found, lead, frames)
    return meant if meant.size > OUTLINE_SHARE * found.size else found


def _meant(found: WindowObject, lead: Lead, frames: Sequence[SightedFrame]) -> WindowObject:
    """The mover with those of its points that its proposer meant or that free space accuses."""
    picked = {}
    for frame in frames:
        if frame.index in found.picked:
            own = found.picked[frame.index]
            meant = np.isin(own, lead.picked.get(frame.index, _NONE))
            kept = own[meant | (frame.through[own] > frame.met[own])]
            if len(kept):
                picked[frame.index] = kept
    return replace(found, picked=picked)


class _Claimed:
    """The movers found so far and the obstacles that are theirs."""

    def __init__(
        self, frames: Sequence[SightedFrame], objects: Sequence[WindowObject] = ()
    ) -> None:
        self._frames = frames
        self._taken = {frame.index: np.zeros(len(frame.rows), dtype=np.bool_) for frame in frames}
        self.objects: list[WindowObject] = []
        for one in objects:
            self.add(one)

    def share(self, suspect: Suspect) -> float:
        """How much of a suspect is a mover's already."""
        taken = self._taken[self._frames[suspect.frame].index][suspect.picked]
        return float(taken.mean())

    def add(self, found: WindowObject | None) -> None:
        """A mover, where one was found."""
        if found is None:
            return
        for index, picked in found.picked.items():
            self._taken[index][picked] = True
        self.objects.append(found)


def _expected_velocities(
    suspect: Suspect, stamp: float, expected: Sequence[Expectation]
) -> NDArray[np.float64]:
    """Velocities (H, 3) of those movers that the suspect may well be."""
    return np.array(
        [
            mover.velocity
            for mover in expected
            if np.linalg.norm(mover.centre_at(stamp) - suspect.centre) < EXPECTED_M
        ]
    ).reshape(-1, 3)
