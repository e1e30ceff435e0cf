"""Named methods behind one interface: what finds poses, and what finds movers.

Each says what truth it is told. None is told poses, unless the user gives them to all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lidaraccum.data.window import Window
from lidaraccum.errors import SettingsError
from lidaraccum.evaluation.seen_through import SeenThrough
from lidaraccum.evaluation.told_masks import ToldMasks, by_centroids, by_icp, by_tracking
from lidaraccum.evaluation.truth import WindowTruth
from lidaraccum.pipeline.label_free import LabelFree
from lidaraccum.pipeline.perception import AllStatic, GivenLabels, Perceiver

ChoosePerceiver = Callable[[Window, WindowTruth], Perceiver]

NOTHING = "nothing"
MASKS = "which points are foreground and which move"


@dataclass(frozen=True)
class Method:
    """One way of doing the job.

    Attributes:
        name: For ``--method`` and tables.
        told: What truth it is told, in words.
        perceiver: Makes what finds the movers of a window.
        chained: Poses are chained from frame to frame, not found on a map.
    """

    name: str
    told: str
    perceiver: ChoosePerceiver
    chained: bool = False


def _ego_only(window: Window, truth: WindowTruth) -> Perceiver:
    """Everything stands still; told nothing."""
    return AllStatic()


def _oracle(window: Window, truth: WindowTruth) -> Perceiver:
    """Told the labels of all points and the boxes of all movers, in place of the network."""
    return GivenLabels(window, truth.movers)


def _center(window: Window, truth: WindowTruth) -> Perceiver:
    """Told the masks; DBSCAN over the window, objects moved by their centroids (supplement)."""
    return ToldMasks(window, by_centroids)


def _center_icp(window: Window, truth: WindowTruth) -> Perceiver:
    """Told the masks; as ``center``, refined by ICP onto the target frame (supplement)."""
    return ToldMasks(window, by_icp)


def _kalman(window: Window, truth: WindowTruth) -> Perceiver:
    """Told the masks; objects of each frame followed by a Kalman filter (table 4)."""
    return ToldMasks(window, by_tracking)


def _cluster_icp(window: Window, truth: WindowTruth) -> Perceiver:
    """The label-free path: free space, clusters, votes of point differences, ICP with acceptance.

    After ICP-Flow (Lin and Caesar, CVPR 2024) and DUFOMap; told nothing.
    """
    return LabelFree()


def _freespace(window: Window, truth: WindowTruth) -> Perceiver:
    """Motion labels from free space alone, movers left where they were seen; told nothing."""
    return SeenThrough()


METHODS = (
    Method("ego-only", NOTHING, _ego_only),
    Method("chained", NOTHING, _ego_only, chained=True),
    Method("freespace", NOTHING, _freespace),
    Method("cluster-icp", NOTHING, _cluster_icp),
    Method("center", MASKS, _center),
    Method("center-icp", MASKS, _center_icp),
    Method("kalman", MASKS, _kalman),
    Method("oracle", "labels, objects and their motions", _oracle),
)
ALSO_CALLED = {"label-free": "cluster-icp"}
"""What `accumulate` calls it."""


def method_by_name(name: str) -> Method:
    """The method called so.

    Raises:
        SettingsError: None is.
    """
    for method in METHODS:
        if method.name == ALSO_CALLED.get(name, name):
            return method
    names = ", ".join(method.name for method in METHODS)
    raise SettingsError(f"there is no method {name!r}", hint=f"one of {names}")
