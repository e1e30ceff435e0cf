"""The network doing all of it: its own poses, masks, objects and motions. No truth in here."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from lidaraccum.geometry.carried import TRAVELLED_M, carried
from lidaraccum.geometry.clustering import connected_cells, dense_groups
from lidaraccum.geometry.voxel import voxel_keys
from lidaraccum.model.answers import FrameFeatures, ObjectMotions, Perception
from lidaraccum.model.batch import FrameTensors, to_arrays, to_indices
from lidaraccum.model.kabsch import chain, invert, move
from lidaraccum.model.motion import Windows
from lidaraccum.model.network import MOST_POINTS, Network
from lidaraccum.model.tubes import centre_by_time

VOXEL_M = 0.15
"""The paper, section 3.4: points are thinned before they are clustered."""
CELL_M = 0.05
RADIUS_M = 0.4
NEIGHBOURS = 5
MIN_VOXELS = 15
"""DBSCAN of positions plus offsets, seen from above, and its least cluster; METHOD.md section 4."""
MOVES_MPS = 0.5
"""What goes slower is not dynamic; METHOD.md section 9."""
BESIDE_M, BESIDE_SHARE, ALIKE = 2.0, 0.1, 0.1
"""Of what drives beside a sensor no such share comes so near, seen from above; who goes alike is
apart from it by no more than such a share of the way."""
TALLEST_M = 4.6
"""A double-decker."""
GAP_M, STRAY_SHARE = 0.4, 0.05
"""What such a gap parts from the rest of an object, and is a smaller share, says nothing of it."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What is said of the P points of one window's frames.

    Attributes:
        placed: (P, 3) float64 metres: where they belong in the target's sensor coordinates.
        dynamic: (P,) bool.
        instance: (P,) int64, 0 for none.
    """

    placed: NDArray[np.float64]
    dynamic: NDArray[np.bool_]
    instance: NDArray[np.int64]


def answer_alone(
    network: Network,
    features: FrameFeatures,
    windows: Windows,
    target_from_source: torch.Tensor,
    without: Set[str] = frozenset(),
) -> Answer:
    """What the network says of one window, with its own poses of the source frames.

    ``without`` some of ``motion`` (what may move goes as its object does, even where it seems to
    stand) and ``offsets`` (objects are what lies together), it says what the paper's ablations do.
    """
    frames, target = features.frames, windows.target[0]
    poses = own_poses(windows, target_from_source)
    seen = network.perceive(features, poses, windows, most=MOST_POINTS)
    movable = seen.foreground > 0
    movable[_carried(frames, seen, poses, movable)] = False
    moving = movable if "motion" in without else movable & (seen.dynamic > 0)
    if "offsets" in without:
        seen = replace(seen, offset=torch.zeros_like(seen.offset))
    ids = torch.zeros_like(seen.point)
    # A car that passes a parked one points to a place beside it: they are no one object.
    ids[moving] = _clusters(seen, moving, 0).to(ids.device)
    rest = movable & ~moving
    ids[rest] = _clusters(seen, rest, int(ids.max()) if len(ids) else 0).to(ids.device)
    level = chain(frames.level_from_sensor[target], poses, invert(frames.level_from_sensor))
    placed = move_frames(frames, level)
    chosen = ids > 0
    if chosen.any():
        speaks = chosen & _speaking(seen, ids)
        objects = network.track(seen, torch.where(speaks, ids, 0))
        own = torch.searchsorted(objects.ids, ids[chosen])
        if "motion" not in without:
            sensors = move(level, frames.level_from_sensor[:, :3, 3][:, None])[:, 0]
            stands = stand(objects) | go_along(objects, seen.position[speaks], sensors)
            moving[chosen] &= ~(stands | tower(objects))[own]
        motion = objects.target_from_aligned[own, seen.frame[chosen]]
        there = move(motion, seen.position[chosen][:, None])[:, 0]
        goes = moving[chosen]
        placed[seen.point[chosen][goes]] = there[goes]
    dynamic = torch.zeros(len(placed), dtype=torch.bool, device=placed.device)
    dynamic[seen.point] = moving
    instance = torch.zeros(len(placed), dtype=torch.int64, device=placed.device)
    instance[seen.point] = ids
    sensor = move(invert(frames.level_from_sensor[target]), placed)
    return Answer(to_arrays(sensor), dynamic.cpu().numpy(), to_indices(instance))


def move_frames(frames: FrameTensors, motion: torch.Tensor) -> torch.Tensor:
    """The points (P, 3), each moved by its frame's motion (F, 4, 4) out of level coordinates."""
    parts = torch.split(frames.points, list(frames.point_counts))
    return torch.cat([move(own, part) for own, part in zip(motion, parts, strict=True)])


def own_poses(windows: Windows, target_from_source: torch.Tensor) -> torch.Tensor:
    """(F, 4, 4) target_from_frame of all frames: proposed for the sources, identity for targets."""
    proposed = target_from_source.float()
    poses = torch.eye(4, device=proposed.device).repeat(sum(windows.lengths), 1, 1)
    return poses.index_copy(0, torch.tensor(windows.sources, device=proposed.device), proposed)


def _carried(
    frames: FrameTensors, seen: Perception, poses: torch.Tensor, movable: torch.Tensor
) -> torch.Tensor:
    """(Q,) bool: which of the movable points (Q,) bool are the sensor's own carrier."""
    stays = torch.zeros_like(movable)
    frame, point = seen.frame[movable], seen.point[movable]
    sensor = move(invert(frames.level_from_sensor)[frame], frames.points[point][:, None])[:, 0]
    gone = poses[:, :3, 3]
    travelled = to_arrays(gone[torch.linalg.vector_norm(gone, dim=1).argmax()])
    own = carried(to_arrays(sensor), to_indices(frame), len(frames), travelled)
    stays[movable] = torch.from_numpy(own).to(stays.device)
    return stays


def _clusters(seen: Perception, chosen: torch.Tensor, after: int) -> torch.Tensor:
    """Objects of some of the points, 0 for none, numbered from ``after`` on."""
    positions, offsets = to_arrays(seen.position[chosen]), to_arrays(seen.offset[chosen])
    objects = cluster_by_offsets(positions, offsets)
    return torch.from_numpy(np.where(objects > 0, objects + after, 0))


def stand(objects: ObjectMotions) -> torch.Tensor:
    """(K,) bool: which objects go slower than what counts as moving, by all they are seen to go."""
    far, seconds = _furthest(objects)
    way = torch.linalg.vector_norm(_gone(objects, far), dim=1)
    return (seconds > 0) & (way < MOVES_MPS * seconds)


def go_along(objects: ObjectMotions, position: torch.Tensor, sensors: torch.Tensor) -> torch.Tensor:
    """(K,) bool: which objects go as the sensor goes and begin at it: spray, rain, its carrier.

    Args:
        objects: K of one window.
        position: (N, 3) metres, of the points that were named.
        sensors: (F, 3) where the sensor was in each frame, metres, both ego-aligned.
    """
    far, _ = _furthest(objects)
    travelled = sensors[objects.tubes.anchor_time] - sensors[far]
    length = torch.linalg.vector_norm(travelled, dim=1)
    apart = torch.linalg.vector_norm(_gone(objects, far) - travelled, dim=1)
    alike = (length > TRAVELLED_M) & (apart < ALIKE * length)
    aside = torch.linalg.vector_norm((position - sensors[objects.time])[:, :2], dim=1)
    count = torch.bincount(objects.instance, minlength=len(far))
    near = torch.bincount(objects.instance[aside < BESIDE_M], minlength=len(far))
    return alike & (near >= BESIDE_SHARE * count)


def tower(objects: ObjectMotions) -> torch.Tensor:
    """(K,) bool: which objects are taller than anything that drives, but for strays."""
    tubes = objects.tubes
    counts = tubes.counts.sum(dim=1)
    upward = torch.argsort(tubes.relative[:, 2])
    upward = upward[torch.argsort(tubes.instance[upward], stable=True)]
    height = tubes.relative[upward, 2]  # by object
    first = counts.cumsum(0) - counts
    strays = (STRAY_SHARE * counts / 2).floor().long()
    rise = height[first + counts - 1 - strays] - height[first + strays]
    return rise > TALLEST_M


def _furthest(objects: ObjectMotions) -> tuple[torch.Tensor, torch.Tensor]:
    """(K,) int64 the time furthest from the anchor's at which each is seen, (K,) seconds apart."""
    seconds, far = objects.tubes.seconds_by_time().abs().max(dim=1)
    return far, seconds


def _gone(objects: ObjectMotions, far: torch.Tensor) -> torch.Tensor:
    """(K, 3) metres that objects' middles go from a time (K,) to the anchor's."""
    tubes = objects.tubes
    each = torch.arange(len(far), device=far.device)
    middle = tubes.anchor + centre_by_time(tubes.relative, tubes)[each, far]
    there = move(objects.target_from_aligned[each, far], middle[:, None])[:, 0]
    return there - middle


def _speaking(seen: Perception, ids: torch.Tensor) -> torch.Tensor:
    """(Q,) bool: which points of objects (Q,), 0 for none, may speak for how those went."""
    speaks = hang_together(to_arrays(seen.position), to_indices(ids), to_indices(seen.frame))
    return torch.from_numpy(speaks).to(ids.device)


def hang_together(
    positions: NDArray[np.float64], objects: NDArray[np.int64], frame: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Which points (N,) are in an object, and in their frame no small share apart from its rest.

    An echo of the rain before a car would be its foremost point.

    Args:
        positions: (N, 3) metres.
        objects: (N,), 0 for none.
        frame: (N,).
    """
    together = np.zeros(len(objects), dtype=np.bool_)
    for one in np.unique(objects[objects > 0]):
        mine = np.flatnonzero(objects == one)
        for when in np.unique(frame[mine]):
            shown = mine[frame[mine] == when]
            part = connected_cells(positions[shown], GAP_M)
            _, first = np.unique(voxel_keys(positions[shown], VOXEL_M), return_index=True)
            counts = np.bincount(part[first], minlength=part.max() + 1)
            together[shown] = counts[part] >= min(STRAY_SHARE * len(first), counts.max())
    return together


def cluster_by_offsets(
    positions: NDArray[np.float64], offsets: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Object (N,), 0 for none, from 1, of points (N, 3) with offsets (N, 2) to centres, metres.

    Source: the paper, section 3.4.
    """
    if len(positions) == 0:
        return np.zeros(0, dtype=np.int64)
    keys = voxel_keys(positions, VOXEL_M)
    _, voxel, counts = np.unique(keys, return_inverse=True, return_counts=True)
    centres = (positions[:, :2] + offsets).T
    means = np.stack([np.bincount(voxel, axis) / counts for axis in centres], axis=1)
    cluster = dense_groups(means, CELL_M, RADIUS_M, NEIGHBOURS)
    sizes = np.bincount(cluster[cluster >= 0], minlength=1)
    kept = np.flatnonzero(sizes >= MIN_VOXELS)
    number = np.zeros(len(sizes) + 1, dtype=np.int64)
    number[kept] = np.arange(1, len(kept) + 1)
    return number[cluster][voxel]
