"""One frame's answer put together: which points are whose, and where each mover is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.data.accumulation import BACKGROUND, MOVING, STILL
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.geometry import rigid
from lidaraccum.geometry.clustering import connected_cells
from lidaraccum.pipeline.association import Track
from lidaraccum.pipeline.courses import course, turned
from lidaraccum.pipeline.extents import length_along, seconds_at_place
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.gathering import without_outlasting, without_strays
from lidaraccum.pipeline.shape import ObjectShape

FOOT_REACH_M = 0.2
"""Low points this near to an object's obstacles, seen from above, are its wheels and shoes."""

ROUND_M = (0.3, 1.0)
ROUND_LEAST = 10
ROUND_SHARE = 0.9
STANDS_OUT_M = 0.01
FOOT_M = (0.05, 0.1)
UNTOLD_FOOT_M = 0.07
"""If they stand out of the ground round the object: between such distances from it this share of
the ground lies lower by so much. Nowhere is this asked to be less or more; where the ground there
shows fewer points, it is that."""

MOST_MISSED = 1.5
"""A frame that shows less of a mover than its fullest is filled up as if it showed so many times
what it does: it may have missed some, a wall beside it is more."""

LOST_FRAMES = 3
FOUND_M = 0.25
FOUND_SHARE = 0.5
FOUND_GROWTH = 4.0
"""A mover that no window saw is looked for where it should be, in so many frames; there it is when
so many points, against its last, and not many times more, lie this near to its shape."""

CLOSE_CELL_M = 0.3
"""Close points whose cells of this width touch are one thing's."""

_NONE = np.zeros(0, dtype=np.int64)


class Canvas:
    """One frame's answer while it is put together."""

    def __init__(self, frame: SightedFrame) -> None:
        count = len(frame.registered.frame)
        self._frame = frame
        self._label = np.full(count, BACKGROUND, dtype=np.uint8)
        self._instance = np.zeros(count, dtype=np.int32)
        self._confidence = np.zeros(count, dtype=np.float32)
        self._confidence[frame.rows] = np.where(
            frame.through > frame.met, 0.5, 1.0 - 0.5 / (1.0 + frame.met)
        )
        self._poses: dict[int, rigid.Pose] = {}

    def free(self, picked: NDArray[np.int64]) -> NDArray[np.int64]:
        """Those of the picked obstacles (K,) that are no other object's."""
        return picked[self._instance[self._frame.rows[picked]] == 0]

    def paint(self, track: Track, picked: NDArray[np.int64], label: int) -> None:
        """Give obstacles (K,), and what is low beside them, to an object."""
        self._paint_rows(
            track, np.concatenate([self._frame.rows[picked], self._feet_of(picked)]), label
        )

    def _paint_rows(self, track: Track, rows: NDArray[np.int64], label: int) -> None:
        rows = rows[self._instance[rows] == 0]
        self._label[rows] = label
        self._instance[rows] = track.instance
        self._confidence[rows] = min(1.0, 0.5 + 0.5 * track.margin)
        if label == MOVING:
            self._poses[track.instance] = track.world_from_object

    def paint_close(self, track: Track, chosen: NDArray[np.bool_]) -> None:
        """Give a mover those of the close points that are chosen (C,)."""
        self._paint_rows(track, self._frame.close_rows[chosen], MOVING)

    def paint_still(
        self, rows: NDArray[np.int64], instance: int, confidence: NDArray[np.float32]
    ) -> None:
        """Give rows (K,) of the frame to something movable that stands, as sure as (K,) 0..1."""
        self._label[rows] = STILL
        self._instance[rows] = instance
        self._confidence[rows] = confidence

    def instances(self, rows: NDArray[np.int64]) -> NDArray[np.int32]:
        """The objects (K,) of rows (K,) of the frame, 0 for none so far."""
        return self._instance[rows]

    def perceived(self) -> PerceivedFrame:
        """The answer."""
        return PerceivedFrame(
            registered=self._frame.registered,
            label=self._label,
            instance=self._instance,
            confidence=self._confidence,
            world_from_object=self._poses,
            poses_at_stamp=True,
        )

    def _feet_of(self, picked: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of the low points beside obstacles (K,) that stand out of the ground there."""
        frame = self._frame
        (x, y), own = frame.ground, frame.points[picked, :2]
        (west, south), (east, north) = own.min(axis=0) - ROUND_M[1], own.max(axis=0) + ROUND_M[1]
        about = np.flatnonzero((x > west) & (x < east) & (y > south) & (y < north))
        places = np.column_stack([x[about], y[about]])
        distance, _ = cKDTree(own).query(places, distance_upper_bound=ROUND_M[1])
        heights = frame.ground_heights[about]
        foot = heights > _foot_height(heights[(distance > ROUND_M[0]) & np.isfinite(distance)])
        return frame.ground_rows[about[foot & (distance < FOOT_REACH_M)]]


def _foot_height(ground: NDArray[np.float64]) -> float:
    """Above which height, metres, a point is no ground, by heights (G,) of the ground round it."""
    if len(ground) < ROUND_LEAST:
        return UNTOLD_FOOT_M
    return float(np.clip(np.quantile(ground, ROUND_SHARE) + STANDS_OUT_M, *FOOT_M))


def paint_mover(track: Track, frame: SightedFrame, canvas: Canvas, box_growth: float) -> None:
    """Give a mover its points of a frame, from windows or, for a while, from its shape alone."""
    picked = canvas.free(track.picked.get(frame.index, _NONE))
    if len(picked):
        seconds = seconds_at_place(_length(track, frame, picked), track.velocities[frame.index])
        picked = without_strays(frame, without_outlasting(frame, picked, seconds))
        _follow(track, frame, picked)
        inside = canvas.free(_in_box(track, frame, box_growth))
        inside = inside[~frame.outlasts(inside, seconds)]
        canvas.paint(track, np.union1d(picked, inside), MOVING)
        _take_close(track, frame, canvas)
        return
    if track.shape is None or frame.index - track.last_index > LOST_FRAMES:
        return
    seconds = frame.stamp - track.last_stamp
    ahead = rigid.translation(track.velocity * seconds) @ track.world_from_object
    still = np.zeros(3)
    gone_on = canvas.free(_near_shape(track.shape, ahead, frame, track.velocity))
    stayed = canvas.free(_near_shape(track.shape, track.world_from_object, frame, still))
    label, near, pose, velocity = STILL, stayed, track.world_from_object, still
    if len(gone_on) > len(stayed):
        label, near, pose, velocity = MOVING, gone_on, ahead, track.velocity
    if FOUND_SHARE * track.points < len(near) < FOUND_GROWTH * track.points:
        _settle(track, frame, near, pose, velocity)
        canvas.paint(track, near, label)


def _follow(track: Track, frame: SightedFrame, picked: NDArray[np.int64]) -> None:
    """Place a mover in a frame: predicted from the last, then fitted to its shape."""
    velocity = track.velocities[frame.index]
    world = frame.world_at_stamp(picked, velocity)
    if track.shape is None:
        pose = rigid.translation(world.mean(axis=0))
        heading = float(np.arctan2(velocity[1], velocity[0]))
        cosine, sine = np.cos(heading), np.sin(heading)
        pose[:2, :2] = [[cosine, -sine], [sine, cosine]]
        track.shape = ObjectShape(rigid.transform(rigid.invert(pose), world))
    else:
        # Back from this frame's velocity to that of the last, then on along the course.
        seconds, turn = frame.stamp - track.last_stamp, track.turns[frame.index]
        before = turned(velocity, -turn * seconds)
        origin = track.world_from_object[:3, 3]
        pose = course(origin, before, turn, seconds) @ track.world_from_object
        own = rigid.transform(rigid.invert(pose), world)
        fit = track.shape.fit(own)
        pose = pose @ rigid.invert(fit.correction)
        track.shape.add(rigid.transform(fit.correction, own))
    _note(track, frame, pose, len(picked))


def _settle(
    track: Track,
    frame: SightedFrame,
    picked: NDArray[np.int64],
    pose: rigid.Pose,
    velocity: NDArray[np.float64],
) -> None:
    """Place a mover that no window saw in a frame, by its shape alone."""
    assert track.shape is not None
    own = _own_places(pose, frame, picked, velocity)
    pose = pose @ rigid.invert(track.shape.fit(own).correction)
    _note(track, frame, pose, len(picked))


def _note(track: Track, frame: SightedFrame, pose: rigid.Pose, points: int) -> None:
    track.world_from_object = pose
    track.last_index, track.last_stamp = frame.index, frame.stamp
    track.points = points
    track.most_points = max(track.most_points, points)


def _length(track: Track, frame: SightedFrame, picked: NDArray[np.int64]) -> float:
    """How long a mover is: what it has shown or, at first, its obstacles (K,) tell. Metres."""
    if track.shape is None:
        return length_along(frame.world(picked), track.velocities[frame.index])
    return track.shape.length_m


def _in_box(track: Track, frame: SightedFrame, growth: float) -> NDArray[np.int64]:
    """The frame's obstacles (K,) within the mover's box, where nothing else can be.

    None at all when they would outnumber those known to be its own, in this frame and in its
    fullest: then the box is wrong.
    """
    assert track.shape is not None
    velocity = track.velocities[frame.index]
    about = _about_shape(track.shape, track.world_from_object, frame, velocity)
    inside = track.shape.holds(_own_places(track.world_from_object, frame, about, velocity))
    most = growth * min(track.most_points, MOST_MISSED * track.points)
    return about[inside] if inside.sum() < most else _NONE


def _take_close(track: Track, frame: SightedFrame, canvas: Canvas) -> None:
    """Give a mover what might be the carrier's, so close is it, but touches the mover's shape.

    What goes beside the carrier for long shows the middle of its side from nowhere else.
    """
    close = frame.close_points
    if len(close) == 0:
        return
    assert track.shape is not None
    late = frame.seconds_at(close)[:, None] * track.velocities[frame.index]
    world = frame.close_world - late
    own = rigid.transform(rigid.invert(track.world_from_object), world)
    inside = track.shape.holds(own)
    touches = inside & np.isfinite(track.shape.distances(own, FOUND_M))
    if not touches.any():
        return
    part = connected_cells(close, CLOSE_CELL_M)
    on = inside & (np.bincount(part, touches) > 0)[part]
    if on.sum() < FOUND_GROWTH * track.most_points:
        canvas.paint_close(track, on)
        track.shape.add(own[on])


def _near_shape(
    shape: ObjectShape, pose: rigid.Pose, frame: SightedFrame, velocity: NDArray[np.float64]
) -> NDArray[np.int64]:
    """The frame's obstacles (K,) on a shape at a pose, if it moves so."""
    about = _about_shape(shape, pose, frame, velocity)
    own = _own_places(pose, frame, about, velocity)
    return about[np.isfinite(shape.distances(own, FOUND_M))]


def _about_shape(
    shape: ObjectShape, pose: rigid.Pose, frame: SightedFrame, velocity: NDArray[np.float64]
) -> NDArray[np.int64]:
    """The frame's obstacles (K,) that may be within reach of a shape at a pose."""
    way = float(np.abs(frame.seconds).max(initial=0.0) * np.linalg.norm(velocity))
    return frame.about(pose[:3, 3], shape.radius_m + FOUND_M + way)


def _own_places(
    pose: rigid.Pose,
    frame: SightedFrame,
    picked: NDArray[np.int64],
    velocity: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Where obstacles (K,) lie in a thing's coordinates at the stamp, (K, 3), if it moves so."""
    return rigid.transform(rigid.invert(pose), frame.world_at_stamp(picked, velocity))
