"""Baselines that are told which points move, and find objects and their motions themselves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.accumulation import BACKGROUND, MOVING, STILL
from lidaraccum.data.frame import Labels
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.data.window import Window
from lidaraccum.evaluation.clusters import Ids, Points, cluster_window
from lidaraccum.evaluation.object_icp import refine
from lidaraccum.evaluation.tracking import KalmanTracker
from lidaraccum.geometry import rigid

Motions = dict[int, rigid.Pose]


@dataclass(frozen=True, eq=False)
class Found:
    """Objects that move through a window.

    Attributes:
        ids: For each frame the object (M,) of each moving point, 0 for none.
        now_from_anchor: For each frame and object: the motion (4, 4), world, from where it was
            in the anchor frame (the nearest to the target that shows it) to where it is now.
    """

    ids: Sequence[Ids]
    now_from_anchor: Sequence[Mapping[int, rigid.Pose]]


class Finder(Protocol):
    """Objects and their motions from moving points."""

    def __call__(self, points: Sequence[Points], stamps: Sequence[float], target: int) -> Found:
        """Points (M_t, 3) of each frame, world; stamps, seconds; index of the target frame."""


class ToldMasks:
    """A perceiver that takes foreground and motion from the labels, and nothing else."""

    def __init__(self, window: Window, find: Finder) -> None:
        self._window = window
        self._find = find

    def perceive(self, frames: Iterable[RegisteredFrame]) -> Iterator[PerceivedFrame]:
        """All frames of the window at once; still objects are clustered too, apart."""
        registered = list(frames)
        labels = [self._window.labels(index) for index in range(len(registered))]
        moving = [_world(one, truth.dynamic) for one, truth in zip(registered, labels, strict=True)]
        still = [_world(one, _still(truth)) for one, truth in zip(registered, labels, strict=True)]
        stamps = [one.frame.stamp for one in registered]
        found = self._find(moving, stamps, self._window.target)
        standing = cluster_window(still)
        above = max((int(ids.max(initial=0)) for ids in found.ids), default=0)
        for index, (one, truth) in enumerate(zip(registered, labels, strict=True)):
            instance = np.zeros(len(one.frame), dtype=np.int32)
            instance[truth.dynamic] = found.ids[index]
            own = standing[index]
            instance[_still(truth)] = np.where(own > 0, own + above, 0)
            yield PerceivedFrame(
                registered=one,
                label=np.select(
                    [truth.dynamic, truth.foreground], [MOVING, STILL], BACKGROUND
                ).astype(np.uint8),
                instance=instance,
                confidence=np.ones(len(one.frame), dtype=np.float32),
                world_from_object=found.now_from_anchor[index],
            )


def _world(registered: RegisteredFrame, mask: NDArray[np.bool_]) -> Points:
    return rigid.transform(registered.world_from_sensor, registered.frame.points[mask])


def _still(labels: Labels) -> NDArray[np.bool_]:
    return labels.foreground & ~labels.dynamic


def by_centroids(points: Sequence[Points], stamps: Sequence[float], target: int) -> Found:
    """``center``: clusters over the window; an object goes where the mean of its points goes."""
    ids = cluster_window(points)
    return Found(ids, _shifts(_centroids(points, ids), target))


def by_icp(points: Sequence[Points], stamps: Sequence[float], target: int) -> Found:
    """``center-icp``: the same, each motion refined by ICP onto the anchor frame's points."""
    ids = cluster_window(points)
    centroids = _centroids(points, ids)
    refined: list[Motions] = []
    for number, shifts in enumerate(_shifts(centroids, target)):
        motions: Motions = {}
        for instance, shift in shifts.items():
            anchor = _anchor(centroids, instance, target)
            own = points[number][ids[number] == instance]
            goal = points[anchor][ids[anchor] == instance]
            motions[instance] = rigid.invert(refine(own, goal, rigid.invert(shift)))
        refined.append(motions)
    return Found(ids, refined)


def by_tracking(points: Sequence[Points], stamps: Sequence[float], target: int) -> Found:
    """``kalman``: clusters of each frame alone, followed by a Kalman filter of their centroids."""
    tracker = KalmanTracker()
    ids = tracker.follow(points, stamps)
    places = [
        {track.id: track.places[number] for track in tracker.tracks if number in track.places}
        for number in range(len(points))
    ]
    return Found(ids, _shifts(places, target))


def _centroids(points: Sequence[Points], ids: Sequence[Ids]) -> list[dict[int, Points]]:
    return [
        {number: own[of == number].mean(axis=0) for number in np.unique(of[of > 0]).tolist()}
        for own, of in zip(points, ids, strict=True)
    ]


def _shifts(places: Sequence[dict[int, Points]], target: int) -> list[Motions]:
    """For each frame and object the shift from its place in the anchor frame to its place now."""
    return [
        {
            instance: rigid.translation(place - places[_anchor(places, instance, target)][instance])
            for instance, place in here.items()
        }
        for here in places
    ]


def _anchor(places: Sequence[dict[int, Points]], instance: int, target: int) -> int:
    showing = [number for number, here in enumerate(places) if instance in here]
    return min(showing, key=lambda number: abs(number - target))
