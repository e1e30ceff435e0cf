"""Named methods behind one interface: what finds poses, and what finds movers.

Each says what truth it is told. None is told poses, unless the user gives them to all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from lidaraccum.data.window import Window
from lidaraccum.errors import SettingsError
from lidaraccum.evaluation.seen_through import SeenThrough
from lidaraccum.evaluation.told_masks import ToldMasks, by_centroids, by_icp, by_tracking
from lidaraccum.evaluation.truth import WindowTruth
from lidaraccum.model.weights import available_weights, chosen_weights, weights_hash
from lidaraccum.pipeline.accumulator import open_reader
from lidaraccum.pipeline.label_free import LabelFree
from lidaraccum.pipeline.network_led import NetworkLed
from lidaraccum.pipeline.perception import AllStatic, GivenLabels, Perceiver
from lidaraccum.pipeline.tubes import Reader

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
        weights: SHA-256 of the network's weights; None where no network runs.
    """

    name: str
    told: str
    perceiver: ChoosePerceiver
    chained: bool = False
    weights: str | None = None


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


NETWORK = "network"


def network_method(weights: Path | None = None) -> Method:
    """The network proposes, geometry verifies; told nothing.

    Args:
        weights: A file; those that came with the package when None.

    Raises:
        InputError: There are none, or they cannot be read.
    """
    path = chosen_weights(weights)
    reader = _kept_reader(path, weights_hash(path))
    return Method(
        NETWORK, NOTHING, lambda window, truth: NetworkLed(reader), weights=reader.weights
    )


@lru_cache(maxsize=1)
def _kept_reader(path: Path, sha256: str) -> Reader:
    """The network of a file, loaded once as long as the file stays the same."""
    return open_reader(path)


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


def all_names(weights: Path | None = None) -> tuple[str, ...]:
    """Every method; the network where there are weights for it, named or shipped."""
    names = tuple(method.name for method in METHODS)
    return (NETWORK, *names) if available_weights(weights) else names


def method_by_name(name: str, weights: Path | None = None) -> Method:
    """The method called so; ``network`` with the weights of a file, or those shipped.

    Raises:
        SettingsError: None is.
        InputError: The network is asked for and there are no weights, or they cannot be read.
    """
    if name == NETWORK:
        return network_method(weights)
    for method in METHODS:
        if method.name == ALSO_CALLED.get(name, name):
            return method
    names = ", ".join([NETWORK, *(method.name for method in METHODS)])
    raise SettingsError(f"there is no method {name!r}", hint=f"one of {names}")
