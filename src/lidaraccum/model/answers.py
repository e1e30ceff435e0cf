"""What the network says: of frames, of windows, of objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from lidaraccum.model.batch import FrameTensors
from lidaraccum.model.ego_motion import EgoPillars
from lidaraccum.model.motion import Windows
from lidaraccum.model.tube_net import TubeMotions
from lidaraccum.model.tubes import Tubes


@dataclass(frozen=True, eq=False)
class FrameFeatures:
    """What the network says of F frames, each by itself; kept by a stream frame by frame.

    Attributes:
        frames: The frames' points and pillars.
        maps: Base features, level coordinates, x by row and y by column: (1, C, S, S) of each
            frame. Frame by frame, for a window of them is too large to be copied together.
        foreground: (V,) float32 logits of the occupied pillars: on something that can move.
        ego: The background pillars that speak for each frame; none where nobody is to match them.
    """

    frames: FrameTensors
    maps: tuple[torch.Tensor, ...]
    foreground: torch.Tensor
    ego: EgoPillars

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def base(self) -> torch.Tensor:
        """(F, C, S, S): the maps in one tensor, a copy."""
        return torch.cat(self.maps)

    def select(self, index: int) -> FrameFeatures:
        """One of the frames alone."""
        first = sum(self.frames.pillar_counts[:index])
        own = slice(first, first + self.frames.pillar_counts[index])
        return FrameFeatures(
            self.frames.select(index),
            self.maps[index : index + 1],
            self.foreground[own],
            self.ego.pick(torch.tensor([index], device=self.foreground.device)),
        )

    @staticmethod
    def stack(parts: Sequence[FrameFeatures]) -> FrameFeatures:
        """Several put one after another; their grids must be the same."""
        return FrameFeatures(
            FrameTensors.stack([part.frames for part in parts]),
            tuple(one for part in parts for one in part.maps),
            torch.cat([part.foreground for part in parts]),
            EgoPillars.stack([part.ego for part in parts]),
        )


@dataclass(frozen=True, eq=False)
class Perception:
    """What the network says of the Q points it looked at closely, in W windows of known poses.

    All other points are background.

    Attributes:
        windows: Which frames make which window.
        point: (Q,) int64 index into the frames' points.
        frame: (Q,) int64 index of the point's frame.
        position: (Q, 3) metres, ego-aligned: level coordinates of the window's target.
        foreground: (Q,) logit: on something that can move.
        dynamic: (Q,) logit: on something that does move.
        offset: (Q, 2) metres, x and y from the position to its object's centre in the target
            frame, level axes.
        seconds: (Q,) of the point's frame from the target.
        speaker: (Q,) int64, ascending: which of the K points that were read speaks for each.
        features: Motion features (k, D) of the points that were read of each frame, apart: they are
            large, and few are asked for again.
        base: (K, C) base features of their own frames.
    """

    windows: Windows
    point: torch.Tensor
    frame: torch.Tensor
    position: torch.Tensor
    foreground: torch.Tensor
    dynamic: torch.Tensor
    offset: torch.Tensor
    seconds: torch.Tensor
    speaker: torch.Tensor
    features: tuple[torch.Tensor, ...]
    base: torch.Tensor

    @property
    def feature(self) -> torch.Tensor:
        """(K, D): the features in one tensor, a copy."""
        return torch.cat(self.features)

    def features_of(self, chosen: torch.Tensor) -> torch.Tensor:
        """(N, D) features of chosen points, (N,) int64 ascending."""
        wanted, first, parts = self.speaker[chosen], 0, []
        for one in self.features:
            own = wanted[(wanted >= first) & (wanted < first + len(one))] - first
            parts.append(one[own])
            first += len(one)
        return torch.cat(parts)

    def base_of(self, chosen: torch.Tensor) -> torch.Tensor:
        """(N, C) base features of chosen points, (N,) int64."""
        return self.base[self.speaker[chosen]]


@dataclass(frozen=True, eq=False)
class ObjectMotions:
    """Proposed motions of K objects.

    Attributes:
        ids: (K,) int64: the caller's, ascending.
        window: (K,) int64 window each is in.
        instance: (N,) int64, 0..K-1, of the points that were named, in order.
        time: (N,) int64 rank of their frames in their windows.
        tubes: Their points, as TubeNet saw them.
        motions: What TubeNet regressed, about the objects' anchors.
        target_from_aligned: (K, T, 4, 4): from the object's ego-aligned place at each time of its
            window to its place at the anchor's time; level coordinates of the target. The
            identity at the anchor's own time and where the object is not seen.
    """

    ids: torch.Tensor
    window: torch.Tensor
    instance: torch.Tensor
    time: torch.Tensor
    tubes: Tubes
    motions: TubeMotions
    target_from_aligned: torch.Tensor
