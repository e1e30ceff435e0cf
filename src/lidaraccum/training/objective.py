"""The whole loss of a batch: the paper's equation 1 over the network's four verbs."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal

import torch

from lidaraccum.errors import SettingsError
from lidaraccum.model.answers import FrameFeatures, ObjectMotions, Perception
from lidaraccum.model.kabsch import chain, compose, invert, move
from lidaraccum.model.looking import close_pillars, doubtful_pillars, points_of
from lidaraccum.model.network import Network
from lidaraccum.model.quaternion import rotation_of
from lidaraccum.training.clusters import ClusterSettings, imperfect_clusters, truth_of_clusters
from lidaraccum.training.losses import (
    ego_loss,
    object_loss,
    object_weights,
    offset_loss,
    segmentation_loss,
)
from lidaraccum.training.window import Batch, Truth

Poses = Literal["true", "noisy", "own"]


@dataclass(frozen=True)
class ObjectiveSettings:
    """What the loss is made of.

    Attributes:
        poses: Which poses the motion branch is given: the true ones, true ones with noise (as a
            verified pose still has), or those the network proposes.
        noise_m: One sigma of the noise's shift.
        noise_deg: One sigma of the noise's turn.
        detach_motion: Keep the motion branch's gradient out of the base features.
        most_points: Points looked at closely in one window; more are thinned by lot.
        clusters: How wrong the objects are that TubeNet gets.
        ego_weight: Of the ego-motion's term; foreground and motion count once each.
        offset_weight: Of the offsets' term.
        object_weight: Of the objects' motions' term.
        rotation_weight: Of turns in it. The paper's 50 has hardly anything else learned: a degree
            counts as 44 cm.
        tube_alone: Nothing but TubeNet learns, which costs a third.
        cluster_draws: So many times the objects of a window are made wrong anew.
    """

    poses: Poses = "noisy"
    noise_m: float = 0.03
    noise_deg: float = 0.1
    detach_motion: bool = False
    most_points: int = 16384
    clusters: ClusterSettings = field(default_factory=ClusterSettings)
    ego_weight: float = 1.0
    offset_weight: float = 0.5
    object_weight: float = 0.3
    rotation_weight: float = 2.0
    tube_alone: bool = False
    cluster_draws: int = 1

    def __post_init__(self) -> None:
        if self.poses not in ("true", "noisy", "own"):
            raise SettingsError(f"poses are true, noisy or own, not {self.poses!r}")
        if min(self.ego_weight, self.offset_weight, self.object_weight) < 0.0:
            raise SettingsError("weights of the loss's terms are 0 or more")
        if self.rotation_weight < 0.0 or self.cluster_draws < 1:
            raise SettingsError("rotation_weight is 0 or more, cluster_draws at least 1")
        if self.tube_alone and self.poses == "own":
            raise SettingsError("TubeNet alone learns from true or noisy poses")


@dataclass(frozen=True, eq=False)
class Losses:
    """The terms, unweighted scalars, and their weighted sum."""

    total: torch.Tensor
    ego: torch.Tensor
    foreground: torch.Tensor
    motion: torch.Tensor
    offset: torch.Tensor
    objects: torch.Tensor

    def numbers(self) -> list[float]:
        """The terms as floats, in order, in one transfer."""
        terms = [getattr(self, name) for name in LOSS_NAMES]
        return torch.stack(terms).detach().cpu().tolist()


LOSS_NAMES = tuple(item.name for item in fields(Losses))
"""Of the terms, in the order of `Losses.numbers`."""


def objective(
    network: Network, batch: Batch, settings: ObjectiveSettings, generator: torch.Generator
) -> Losses:
    """The loss of one batch.

    Args:
        network: In training.
        batch: Windows with their truth.
        settings: What the loss is made of.
        generator: On the CPU; draws pillars, noise, points and clusters.
    """
    if settings.tube_alone:
        return _objective_of_tubes(network, batch, settings, generator)
    truth = batch.truth
    choice = int(torch.randint(1, 1 << 30, (1,), generator=generator))
    features = network.encode(batch.frames, choice)
    match = network.match_windows(features, batch.windows)
    sources = source_index(batch).to(truth.known.device)
    ego = ego_loss(match, truth.level_target_from_frame[sources])
    poses = _given_poses(batch, match.target_from_source, settings, generator)
    points = _points_to_teach(
        features, truth, network.settings.glance_odds, settings.most_points, generator
    )
    perception = network.perceive(
        features, poses, batch.windows, points, detach=settings.detach_motion
    )
    foreground = pillar_loss(features, truth) + segmentation_loss(
        perception.foreground, truth.foreground[points]
    )
    motion = segmentation_loss(perception.dynamic, truth.dynamic[points])
    aligned_from_object = object_poses(batch, poses)
    offset = _offset_loss(perception, truth, aligned_from_object)
    objects = _object_loss(network, perception, truth, aligned_from_object, settings, generator)
    total = settings.ego_weight * ego + foreground + motion
    total = total + settings.offset_weight * offset + settings.object_weight * objects
    return Losses(total, ego, foreground, motion, offset, objects)


def _objective_of_tubes(
    network: Network, batch: Batch, settings: ObjectiveSettings, generator: torch.Generator
) -> Losses:
    """The loss with a gradient for TubeNet alone; all other terms are 0."""
    truth = batch.truth
    with torch.no_grad():
        features = network.encode(batch.frames, matchable=False)
        poses = _given_poses(batch, truth.target_from_frame[:0], settings, generator)
        points = _points_to_teach(
            features, truth, network.settings.glance_odds, settings.most_points, generator
        )
        perception = network.perceive(features, poses, batch.windows, points)
    aligned_from_object = object_poses(batch, poses)
    objects = _object_loss(network, perception, truth, aligned_from_object, settings, generator)
    nothing = torch.zeros_like(objects)
    total = settings.object_weight * objects
    return Losses(total, nothing, nothing, nothing, nothing, objects)


def source_index(batch: Batch) -> torch.Tensor:
    """(B,) int64 frames that are not their window's target, in order."""
    return torch.tensor(batch.windows.sources)


def pillar_loss(features: FrameFeatures, truth: Truth) -> torch.Tensor:
    """Foreground loss of the pillars that hold an annotated point."""
    slots = features.frames.pillar
    empty = torch.zeros(len(features.foreground), device=slots.device)
    told = empty.scatter_reduce(0, slots, truth.annotated.float(), "amax") > 0
    label = empty.scatter_reduce(0, slots, truth.foreground.float(), "amax") > 0
    return segmentation_loss(features.foreground[told], label[told])


def _given_poses(
    batch: Batch, own: torch.Tensor, settings: ObjectiveSettings, generator: torch.Generator
) -> torch.Tensor:
    """(F, 4, 4) target_from_frame for the motion branch; targets stay the identity."""
    poses = batch.truth.target_from_frame
    index = source_index(batch).to(poses.device)
    if settings.poses == "own":
        return poses.index_copy(0, index, own.detach())
    if settings.poses == "noisy":
        noise = torch.randn(len(index), 6, generator=generator).to(poses.device)
        half_turn = torch.deg2rad(noise[:, 3:] * settings.noise_deg) / 2
        quaternion = torch.cat([torch.ones_like(half_turn[:, :1]), half_turn], dim=1)
        shaken = compose(rotation_of(quaternion), noise[:, :3] * settings.noise_m)
        return poses.index_copy(0, index, chain(shaken, poses[index]))
    return poses


def _points_to_teach(
    features: FrameFeatures,
    truth: Truth,
    glance_odds: float,
    most: int,
    generator: torch.Generator,
) -> torch.Tensor:
    """Annotated points (Q,), ascending, thinned by lot where too many.

    Those that pass the gate or should have, and, for a third, background that is glanced at: the
    likelier to pass the gate, the likelier drawn.
    """
    device = truth.foreground.device
    wanted = torch.zeros_like(truth.foreground)
    wanted[points_of(features.frames, close_pillars(features.foreground))] = True
    wanted = (wanted | truth.foreground) & truth.annotated
    points = torch.nonzero(wanted)[:, 0]
    glanced = points_of(features.frames, doubtful_pillars(features.foreground, glance_odds))
    glanced = glanced[(truth.annotated & ~truth.foreground)[glanced]]
    aside = min(len(glanced), most // 3, (len(points) + 1) // 2)
    lot = torch.rand(len(glanced), generator=generator).to(device)
    score = features.foreground.detach()[features.frames.pillar[glanced]]
    key = score - torch.log(-torch.log(lot.clamp(1e-7, 1.0 - 1e-7)))  # drawn by their odds
    glanced = glanced[torch.topk(key, aside).indices]
    if len(points) > most - aside:
        kept = torch.randperm(len(points), generator=generator)[: most - aside].to(device)
        points = points[kept]
    return torch.sort(torch.cat([points, glanced])).values


def object_poses(batch: Batch, target_from_frame: torch.Tensor) -> torch.Tensor:
    """(K, T, 4, 4): each object in ego-aligned coordinates, level, as the given poses align it."""
    truth, frames = batch.truth, batch.frames
    owner = torch.tensor(batch.windows.target_of_frame, device=target_from_frame.device)
    level = chain(
        frames.level_from_sensor[owner], target_from_frame, invert(frames.level_from_sensor)
    )
    span = truth.known.shape[1]
    times = truth.first_frame[:, None] + torch.arange(span, device=level.device)
    return chain(level[times.clamp_max(len(level) - 1)], truth.level_from_object)


def true_motion(aligned_from_object: torch.Tensor, anchor_time: torch.Tensor) -> torch.Tensor:
    """(K, T, 4, 4) from where an object is at each time to where it is at its anchor's time."""
    rows = torch.arange(len(anchor_time), device=anchor_time.device)
    return chain(aligned_from_object[rows, anchor_time][:, None], invert(aligned_from_object))


def _offset_loss(
    perception: Perception, truth: Truth, aligned_from_object: torch.Tensor
) -> torch.Tensor:
    target, has = offset_truth(perception, truth, aligned_from_object)
    return offset_loss(perception.offset[has], target[has])


def offset_truth(
    perception: Perception, truth: Truth, aligned_from_object: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """True offsets (Q, 2) metres, and which points (Q,) have one.

    An object's centre is the mean of its points of all frames, brought to its place in the target
    frame; an object unknown there is brought to the nearest time at which it is known.
    """
    row = truth.object_row[perception.point]
    count, span = truth.known.shape
    time = perception.frame - truth.first_frame[row.clamp_min(0)] if count else perception.frame
    if count == 0:
        return torch.zeros_like(perception.offset), torch.zeros_like(row, dtype=torch.bool)
    target = torch.tensor(perception.windows.target_of_frame, device=row.device)
    target_time = target[truth.first_frame] - truth.first_frame
    away = (torch.arange(span, device=row.device)[None] - target_time[:, None]).abs()
    anchor = away.masked_fill(~truth.known, 10 * span).argmin(dim=1)
    motion = true_motion(aligned_from_object, anchor)
    has = row >= 0
    has &= truth.known[row.clamp_min(0), time.clamp(0, span - 1)]
    mine, when = row[has], time[has]
    home = move(motion[mine, when], perception.position[has][:, None])[:, 0, :2]
    points = torch.bincount(mine, minlength=count).clamp_min(1)
    centre = home.new_zeros(count, 2).index_add(0, mine, home) / points[:, None]
    offset = torch.zeros_like(perception.offset)
    offset[has] = centre[mine] - perception.position[has][:, :2]
    return offset, has


def _object_loss(
    network: Network,
    perception: Perception,
    truth: Truth,
    aligned_from_object: torch.Tensor,
    settings: ObjectiveSettings,
    generator: torch.Generator,
) -> torch.Tensor:
    row = truth.object_row[perception.point]
    window = torch.tensor(perception.windows.of_frame, device=row.device)[perception.frame]
    draws = []
    for _ in range(settings.cluster_draws):
        cluster = imperfect_clusters(perception.position, row, window, settings.clusters, generator)
        tracked = _track(network, perception, cluster, row)
        if tracked is None:
            draws.append(perception.feature.sum() * 0.0)
        else:
            objects, owner = tracked
            motion, weight = object_truth(objects, truth, aligned_from_object, owner)
            draws.append(object_loss(objects, motion, weight, settings.rotation_weight))
    return torch.stack(draws).mean()


def _track(
    network: Network, perception: Perception, cluster: torch.Tensor, row: torch.Tensor
) -> tuple[ObjectMotions, torch.Tensor] | None:
    """Motions of K clusters (Q,) that are mostly some object, and its row (K,); None if none is."""
    ids, owner = truth_of_clusters(cluster, row)
    cluster = torch.where(torch.isin(cluster, ids[owner >= 0]), cluster, 0)
    owner = owner[owner >= 0]
    return (network.track(perception, cluster), owner) if len(owner) else None


def object_truth(
    objects: ObjectMotions, truth: Truth, aligned_from_object: torch.Tensor, owner: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """True target_from_aligned (K, T, 4, 4) and weights (K, T) of tracked objects.

    ``owner`` (K,) is the row of the true object behind each.
    """
    span = objects.tubes.counts.shape[1]
    anchor = objects.tubes.anchor_time
    rows = torch.arange(len(anchor), device=anchor.device)
    known = truth.known[owner][:, :span]
    known = known & known[rows, anchor][:, None]
    motion = true_motion(aligned_from_object[owner][:, :span], anchor)
    return motion, object_weights(objects, truth.still[owner], known)
