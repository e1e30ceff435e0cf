"""The five losses, as functions of tensors. Source: the paper, sections 3.1-3.5 and supplement."""

from __future__ import annotations

import torch
from torch.nn import functional

from lidaraccum.model.answers import ObjectMotions
from lidaraccum.model.ego_motion import EgoMatch
from lidaraccum.model.kabsch import about, chain, invert, move
from lidaraccum.model.quaternion import quaternion_of

LARGEST_CLASS_WEIGHT = 50.0
INLIER_WEIGHT = 0.005
ITERATION_WEIGHTS = (0.7, 1.0, 1.0)
"""Of TubeNet's two iterations; where it lays objects over themselves, of that."""
STILL_WEIGHT = 0.2
FEWEST_POINTS = 30
"""Frames in which an object has so few points, thinned, teach nothing about its motion."""
NO_DIRECTION_M = 1e-3
"""An offset shorter than this points nowhere."""


def segmentation_loss(logits: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Weighted cross-entropy plus Lovász, of logits (N,) and truth (N,) bool; 0 for no points."""
    if len(logits) == 0:
        return logits.sum()
    probability = torch.sigmoid(logits.float())
    errors = torch.where(truth, 1.0 - probability, probability)
    return weighted_cross_entropy(logits, truth) + lovasz(errors, truth)


def weighted_cross_entropy(logits: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Mean binary cross-entropy, each class weighted by √(N / N_class), at most 50."""
    positive = truth.sum()
    counts = torch.stack([len(truth) - positive, positive]).clamp_min(1)
    weights = torch.sqrt(len(truth) / counts).clamp_max(LARGEST_CLASS_WEIGHT)
    return functional.binary_cross_entropy_with_logits(
        logits.float(), truth.float(), weight=weights[truth.long()]
    )


def lovasz(errors: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Lovász extension of 1 - Jaccard index of the positive class, at errors (N,) of 0..1.

    0 where nothing is positive: the index of a class that is not there says nothing.

    Source: Berman et al. (CVPR 2018).
    """
    positives = truth.sum()
    ranked, order = torch.sort(errors, descending=True)
    labels = truth[order].float()
    intersection = positives - labels.cumsum(0)
    union = positives + (1.0 - labels).cumsum(0)
    jaccard = 1.0 - intersection / union
    steps = torch.diff(jaccard, prepend=jaccard.new_zeros(1))
    return torch.where(positives > 0, (ranked * steps).sum(), errors.sum() * 0.0)


def ego_loss(match: EgoMatch, true_level: torch.Tensor) -> torch.Tensor:
    """L1 between pillars moved by the estimated and the true motion, plus the inlier loss.

    Every round of matching answers for its own motion, the last for the masses.

    Args:
        match: Of B pairs of frames.
        true_level: (B, 4, 4) true level_target_from_source.
    """
    true = move(true_level, match.source)
    errors = (move(match.rounds, match.source[:, None]) - true[:, None]).abs().sum(dim=3)
    distance = _mean(errors.mean(dim=1), match.source_valid)
    outliers = torch.cat([1.0 - match.row_mass, 1.0 - match.column_mass], dim=1)
    valid = torch.cat([match.source_valid, match.target_valid], dim=1)
    return distance + INLIER_WEIGHT * _mean(outliers, valid)


def offset_loss(offset: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """L1 plus 1 - cosine, of offsets (Q, 2) against true ones, metres; the paper's equation 5.

    A true offset of nothing has no direction, and asks for none.
    """
    if len(offset) == 0:
        return offset.sum()
    length = (offset - truth).abs().sum(dim=1)
    away = 1.0 - functional.cosine_similarity(offset, truth, dim=1, eps=1e-6)
    has_direction = torch.linalg.vector_norm(truth, dim=1) > NO_DIRECTION_M
    return (length + away * has_direction).mean()


def object_loss(
    objects: ObjectMotions,
    true_motion: torch.Tensor,
    weight: torch.Tensor,
    rotation_weight: float,
) -> torch.Tensor:
    """TubeNet's loss over its iterations: moved points, translation, and rotation.

    Args:
        objects: K objects over T times.
        true_motion: (K, T, 4, 4) true target_from_aligned, level coordinates of the target.
        weight: (K, T) of each object and time; see `object_weights`.
        rotation_weight: How much a quaternion's error counts; 50 in the paper.
    """
    tubes = objects.tubes
    truth = about(true_motion, tubes.anchor[:, None])
    before = torch.eye(4, device=truth.device).expand_as(truth)
    total = truth.new_zeros(())
    steps = zip(
        ITERATION_WEIGHTS[: len(objects.motions.shift)],
        objects.motions.quaternion,
        objects.motions.shift,
        objects.motions.anchor_from_time,
        strict=True,
    )
    for share, quaternion, shift, motion in steps:
        missing = chain(truth, invert(before))
        turned = functional.normalize(quaternion, dim=-1) - quaternion_of(missing[..., :3, :3])
        regressed = _length(shift - missing[..., :3, 3]) + rotation_weight * _length(turned)
        total = total + share * (_mean(regressed, weight) + _moved(motion, truth, objects, weight))
        before = motion.detach()
    return total


def object_weights(
    objects: ObjectMotions, still: torch.Tensor, known: torch.Tensor
) -> torch.Tensor:
    """Weights (K, T): more for frames far from the target, little for still objects.

    What shows many points counts more, by their root: it is what a map shows. Nothing for the
    anchor's own frame, for frames with too few points, and where the truth (``known`` (K, T) bool)
    is missing; ``still`` is (K,) bool.
    """
    counts = objects.tubes.counts
    span = counts.shape[1]
    ranks = torch.arange(span, device=counts.device)[None]
    away = (ranks - objects.tubes.anchor_time[:, None]).abs()
    weight = (away + 1.0) / span * torch.where(still, STILL_WEIGHT, 1.0)[:, None]
    dense = torch.sqrt(counts / FEWEST_POINTS)
    return weight * dense * ((counts > FEWEST_POINTS) & (away > 0) & known)


def _moved(
    motion: torch.Tensor, truth: torch.Tensor, objects: ObjectMotions, weight: torch.Tensor
) -> torch.Tensor:
    """Mean L1 between points moved by the regressed and the true motion, weighted."""
    tubes = objects.tubes
    points = tubes.relative[:, None]
    there = move(motion[tubes.instance, tubes.time], points)[:, 0]
    true = move(truth[tubes.instance, tubes.time], points)[:, 0]
    share = weight / tubes.counts.clamp_min(1)  # each object and time counts by its weight alone
    error = (there - true).abs().sum(dim=1) * share[tubes.instance, tubes.time]
    return error.sum() / weight.sum().clamp_min(1e-6)


def _length(vector: torch.Tensor) -> torch.Tensor:
    """Length (...) of vectors (..., D), with a gradient at 0 too."""
    return torch.sqrt((vector * vector).sum(dim=-1) + 1e-12)


def _mean(values: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """Mean of values by weights of their shape (bool or number); 0 without any weight."""
    share = weight.to(values.dtype)
    return (values * share).sum() / share.sum().clamp_min(1e-6)
