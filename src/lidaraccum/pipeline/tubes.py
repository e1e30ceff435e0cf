"""What the network takes for one mover: its points in all frames of a window, and its motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid
from lidaraccum.geometry.clustering import dense_groups
from lidaraccum.model.reading import ObjectReading, WindowReading
from lidaraccum.pipeline.courses import turned
from lidaraccum.pipeline.extents import LONGEST_M, length_along, seconds_at_place
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.gathering import without_outlasting
from lidaraccum.pipeline.motion_settings import MotionSettings
from lidaraccum.pipeline.suspects import Lead, Suspect

MOVING_ABOVE = 0.5
"""Points whose probability of moving is higher are part of a proposed mover."""

CELL_M = 0.1
RADIUS_M = 0.4
NEIGHBOURS = 5
"""DBSCAN of points at the centres they point to, seen from above; METHOD.md section 4. Many points
to one centre make one cell."""

SLOWEST_MPS = 0.5
"""What seems to go slower is not asked how long it was where."""

MOST_TUBES = 60
"""So many movers a window are proposed at most, the largest: weights that take everything for
moving cost time, but not without end."""


class Reader(Protocol):
    """The network, as far as the pipeline knows it: `lidaraccum.model.reader.NetworkReader`."""

    @property
    def weights(self) -> str:
        """SHA-256 of its weights, for reports."""

    def read(self, frame: Frame) -> Any:
        """A frame as the network keeps it."""

    def look(
        self, encoded: Sequence[Any], world_from_sensor: NDArray[np.float64], target: int
    ) -> WindowReading:
        """What T frames, as kept, with poses (T, 4, 4) say together."""

    def track(
        self, reading: WindowReading, instances: Sequence[NDArray[np.int64]]
    ) -> ObjectReading:
        """Motions of objects named point by point, 0 for none, in each of the T frames."""


@dataclass(frozen=True, eq=False)
class Tube:
    """A mover as the network proposes it.

    Attributes:
        picked: By frame index in the sequence: which of that frame's obstacles (K,).
        velocity: (3,) m/s, world, level: of its points' centre from frame to frame; NaN in one.
        anchor_from_then: By frame index: the motion (4, 4), world, that the network says took it
            from then to its place in its anchor frame; none where it said nothing.
        stamps: By frame index: seconds.
        trust: Mean probability that its points move.
    """

    picked: Mapping[int, NDArray[np.int64]]
    velocity: NDArray[np.float64]
    anchor_from_then: Mapping[int, rigid.Pose]
    stamps: Mapping[int, float]
    trust: float

    def lead(self, window: Sequence[SightedFrame]) -> Lead | None:
        """The tube's fullest frame in a window as a proposal; None where no frame is in it."""
        shown = [place for place, frame in enumerate(window) if frame.index in self.picked]
        if not shown:
            return None
        place = max(shown, key=lambda place: len(self.picked[window[place].index]))
        picked = self.picked[window[place].index]
        suspect = Suspect(place, picked, window[place].world(picked).mean(axis=0))
        velocities, turns = self._courses(window[place].index, suspect.centre)
        return Lead(suspect, velocities, turns, self.trust, self.picked)

    def _courses(
        self, index: int, centre: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Velocities (H, 3) of a centre (3,) in a frame, and turns (H,) that go with them."""
        ways = [(self.velocity, 0.0)] if np.isfinite(self.velocity).all() else []
        if index in self.anchor_from_then:
            ways += self._regressed(index, centre)
        velocities = np.array([velocity for velocity, _ in ways]).reshape(-1, 3)
        return velocities, np.array([turn for _, turn in ways])

    def _regressed(
        self, index: int, centre: NDArray[np.float64]
    ) -> list[tuple[NDArray[np.float64], float]]:
        """What the network's motions of this frame against all others come to."""
        lags, shifts, angles = [], [], []
        for other, anchor_from_then in self.anchor_from_then.items():
            if other == index:
                continue
            motion = rigid.invert(anchor_from_then) @ self.anchor_from_then[index]
            lags.append(self.stamps[other] - self.stamps[index])
            shifts.append(rigid.transform(motion, centre[None])[0] - centre)
            angles.append(np.arctan2(motion[1, 0], motion[0, 0]))
        if not lags:
            return []
        lag, shift = np.array(lags), np.array(shifts) * (1.0, 1.0, 0.0)
        turn = float(lag @ np.array(angles) / (lag @ lag))
        # Each way is the chord of an arc; turned back by half its angle it tells the start.
        arcs = np.array(
            [turned(one, -0.5 * turn * gap) for one, gap in zip(shift, lag, strict=True)]
        )
        return [(lag @ shift / (lag @ lag), 0.0), (lag @ arcs / (lag @ lag), turn)]


def find_tubes(
    frames: Sequence[SightedFrame],
    reading: WindowReading,
    reader: Reader,
    settings: MotionSettings,
) -> list[Tube]:
    """The movers that the network sees in frames it has looked at together, the largest first."""
    groups = _groups(frames, reading, settings)
    if not groups:
        return []
    instances = [np.zeros(len(one.foreground), dtype=np.int64) for one in reading.frames]
    for number, group in enumerate(groups, start=1):
        for place, picked in group.items():
            instances[place][frames[place].rows[picked]] = number
    motions = reader.track(reading, instances)
    return [
        Tube(
            picked={frames[place].index: picked for place, picked in group.items()},
            velocity=_centroid_velocity(group, frames),
            anchor_from_then=_world_motions(number, group, frames, reading.target, motions),
            stamps={frames[place].index: frames[place].stamp for place in group},
            trust=_trust(group, frames, reading),
        )
        for number, group in enumerate(groups, start=1)
    ]


_Group = dict[int, NDArray[np.int64]]
"""By place in the window: obstacles (K,) of one proposed mover."""


def _groups(
    frames: Sequence[SightedFrame], reading: WindowReading, settings: MotionSettings
) -> list[_Group]:
    """Obstacles that point to one centre, whatever they are."""
    picked, centres, ends = [], [], []
    for frame, one in zip(frames, reading.frames, strict=True):
        moving = np.flatnonzero(one.dynamic[frame.rows] > MOVING_ABOVE)
        picked.append(moving)
        centres.append(frame.world(moving)[:, :2] + one.offset[frame.rows[moving]])
        ends.append(len(moving))
    place = np.repeat(np.arange(len(frames)), ends)
    obstacle = np.concatenate(picked)
    cluster = dense_groups(np.concatenate(centres), CELL_M, RADIUS_M, NEIGHBOURS)
    groups: list[_Group] = []
    for number in range(int(cluster.max(initial=-1)) + 1):
        own = cluster == number
        group = {int(at): obstacle[own & (place == at)] for at in np.unique(place[own]).tolist()}
        group = _passing(group, frames)
        most = max(len(rows) for rows in group.values())
        if most >= settings.min_points and _extent(group, frames) < LONGEST_M:
            groups.append(group)
    groups.sort(key=lambda group: -sum(map(len, group.values())))
    return groups[:MOST_TUBES]


def _passing(group: _Group, frames: Sequence[SightedFrame]) -> _Group:
    """The group without what was at its place longer than anything so fast and long can be."""
    velocity = _centroid_velocity(group, frames)
    if not np.linalg.norm(velocity) > SLOWEST_MPS:
        return group
    place = max(group, key=lambda place: len(group[place]))
    length = length_along(frames[place].world(group[place]), velocity)
    seconds = seconds_at_place(length, velocity)
    return {
        place: without_outlasting(frames[place], picked, seconds) for place, picked in group.items()
    }


def _extent(group: _Group, frames: Sequence[SightedFrame]) -> float:
    """The largest side, metres, of the group in the frame that shows most of it."""
    place = max(group, key=lambda place: len(group[place]))
    return float(np.ptp(frames[place].points[group[place], :2], axis=0).max())


def _centroid_velocity(group: _Group, frames: Sequence[SightedFrame]) -> NDArray[np.float64]:
    """Velocity (3,) at which the points' centre goes from frame to frame; NaN in one alone."""
    weight = np.array([float(len(picked)) for picked in group.values()])
    seconds = np.array([frames[place].stamp for place in group])
    if np.ptp(seconds) == 0:
        return np.full(3, np.nan)
    centres = np.array([frames[place].world(rows).mean(axis=0) for place, rows in group.items()])
    seconds = seconds - np.average(seconds, weights=weight)
    spread = (weight * seconds**2).sum()
    return ((weight * seconds) @ centres / spread) * (1.0, 1.0, 0.0)


def _world_motions(
    number: int,
    group: _Group,
    frames: Sequence[SightedFrame],
    target: int,
    motions: ObjectReading,
) -> dict[int, rigid.Pose]:
    """The network's motions (4, 4) of a group to its anchor, world, by frame index."""
    rows = np.flatnonzero(motions.ids == number)
    if len(rows) == 0:
        return {}
    there, back = frames[target].world_from_sensor, frames[target].sensor_from_world
    return {
        frames[place].index: there @ motions.target_from_aligned[rows[0], place] @ back
        for place in group
        if motions.seen[rows[0], place]
    }


def _trust(group: _Group, frames: Sequence[SightedFrame], reading: WindowReading) -> float:
    """Mean probability that a group's points move."""
    sure = [reading.frames[place].dynamic[frames[place].rows[own]] for place, own in group.items()]
    return float(np.concatenate(sure).mean())
