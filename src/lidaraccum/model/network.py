"""The network's four verbs: encode a frame, match two, perceive a window, track its objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import torch
from torch import nn

from lidaraccum.model.batch import FrameTensors
from lidaraccum.model.ego_motion import (
    EgoHead,
    EgoMatch,
    EgoPillars,
    Matcher,
    choose_background,
    choose_ground,
)
from lidaraccum.model.kabsch import about, chain, invert
from lidaraccum.model.looking import View, speakers_of
from lidaraccum.model.motion import MotionMap, PointHead, Windows
from lidaraccum.model.pillars import PillarEncoder
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.steady import outward, steady
from lidaraccum.model.tube_net import TubeMotions, TubeNet
from lidaraccum.model.tubes import Tubes, gather_tubes, one_of_each_cell
from lidaraccum.model.unet import UNet, channels_last, convolution, to_one_channel

MOST_POINTS = 200_000
"""So many points of a window are looked at closely by those who bound their time: dense sensors,
and weights that take everything for movable, would have many more."""

TUBE_CELL_M = 0.15
"""TubeNet sees one of an object's points in each cell; the paper thins points like this too."""

RARE = -2.0
"""Logit that foreground starts from: most pillars hold none."""


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


class Network(nn.Module):
    """The parts, and the four verbs over them. No poses, labels or decisions of its own."""

    def __init__(self, settings: NetworkSettings | None = None) -> None:
        super().__init__()
        settings = settings or NetworkSettings()
        self.settings = settings
        width = settings.base_widths[0]
        self.pillars = PillarEncoder(settings)
        self.backbone = UNet(width, settings.base_widths)
        scores = nn.Conv2d(width, 1, 3, padding=1)
        self.foreground_head = nn.Sequential(
            convolution(width, width), nn.ReLU(inplace=True), scores
        )
        nn.init.constant_(cast("torch.Tensor", scores.bias), RARE)
        self.ego_head = EgoHead(settings)
        self.matcher = Matcher(settings)
        self.motion_map = MotionMap(settings)
        self.point_head = PointHead(settings)
        self.tube_net = TubeNet(settings)

    def encode(
        self,
        frames: FrameTensors,
        choice: int = 0,
        *,
        matchable: bool = True,
        masked: bool = True,
    ) -> FrameFeatures:
        """Features of F frames, each by itself.

        Args:
            frames: From `batch.to_tensors`.
            choice: Another number draws other background pillars (training).
            matchable: Whether somebody is to match them; else no background pillars are drawn.
            masked: Whether what may move is left out of those; else pillars are drawn of all.
        """
        base = self.backbone(self.pillars(frames))
        narrow, rectify, last = self.foreground_head
        scores = to_one_channel(cast("nn.Conv2d", last), rectify(narrow(base))).float()
        foreground = scores.reshape(-1).index_select(0, frames.pillar_place)
        if matchable:
            odds = foreground.detach() if masked else torch.full_like(foreground, -torch.inf)
            ego = self._ego(frames, base, odds, choice)
        else:
            ego = EgoPillars.none(frames.level_from_sensor, self.settings.ego_channels)
        return FrameFeatures(frames, base.split(1), foreground, ego)

    def _ego(
        self, frames: FrameTensors, base: torch.Tensor, foreground: torch.Tensor, choice: int
    ) -> EgoPillars:
        count, odds = self.settings.ego_pillars, self.settings.standing_odds
        index, valid = choose_background(frames, foreground, count, choice, odds)
        owner = torch.arange(len(frames), device=index.device)[:, None].expand_as(index)
        cell = frames.pillar_cell[index]
        feature = self.ego_head(base, owner.reshape(-1), cell.reshape(-1)).view(*index.shape, -1)
        low, on_ground = choose_ground(frames, foreground, self.settings.ground_pillars)
        return EgoPillars(
            position=frames.pillar_mean[index],
            feature=feature,
            valid=valid,
            ground=frames.pillar_mean[low],
            on_ground=on_ground,
            level_from_sensor=frames.level_from_sensor,
        )

    def match_windows(self, features: FrameFeatures, windows: Windows) -> EgoMatch:
        """Each source frame straight to its window's target, in the frames' order.

        The targets themselves are left out: B is the number of frames less that of windows. The
        targets' neighbours are matched first, within all reach; each further frame is matched to
        the target too, but from where steady motion of the nearer ones puts it.
        """
        device = features.foreground.device
        stamps = features.frames.stamps
        gaps = torch.tensor(windows.gaps(stamps), device=device).float()
        known = torch.eye(4, device=device).repeat(len(features), 1, 1)
        matches: list[EgoMatch] = []
        order: list[int] = []
        for sources in outward(windows) or [[]]:
            targets = [windows.target_of_frame[frame] for frame in sources]
            rows = torch.tensor([sources, targets], dtype=torch.int64, device=device)
            source, target = rows
            match = self.matcher(
                features.ego.pick(source),
                features.ego.pick(target),
                gaps[source],
                steady(known, stamps, sources, windows) if matches else None,
            )
            known = known.index_copy(0, source, match.level_target_from_source.detach())
            matches.append(match)
            order += sources
        back = torch.argsort(torch.tensor(order, dtype=torch.int64, device=device))
        return EgoMatch.stack(matches).pick(back)

    def perceive(
        self,
        features: FrameFeatures,
        target_from_frame: torch.Tensor,
        windows: Windows,
        points: torch.Tensor | None = None,
        *,
        most: int = 0,
        detach: bool = False,
    ) -> Perception:
        """Motion and offsets of the points that seem to be on something that can move.

        Args:
            features: Of all frames of all windows, window by window, in order of time.
            target_from_frame: (F, 4, 4) poses, sensor coordinates: the caller's.
            windows: Which frames make which window.
            points: (Q,) int64, ascending: the points to look at; `View.choose` of them when None.
            most: Read about so many; of more, every second or third of a pillar, which speaks for
                those above it up to the next. 0 for all.
            detach: Keep the motion branch's gradient out of the base features.
        """
        frames = features.frames
        device = features.foreground.device
        base = [one.detach() if detach else one for one in features.maps]
        owner = torch.tensor(windows.target_of_frame, device=device)
        level = chain(
            frames.level_from_sensor[owner],
            target_from_frame.to(device, torch.float32),
            invert(frames.level_from_sensor),
        )
        presence = presence_map(features)
        motion_map = self.motion_map(
            base, presence, level, windows, frames.stamps, frames.half_extent_m
        )
        view = View(frames, windows, base, motion_map, level)
        if points is None:
            points = view.choose(self.point_head, features.foreground, self.settings.glance_odds)
        frame, position, seconds = view.place(points)
        every = len(points) // most + 1 if most else 1
        spoken, speaker = speakers_of(frames.pillar[points], every)
        feature, foreground, dynamic, offset, own_base = view.ask(
            self.point_head, points[spoken], frame[spoken], position[spoken], seconds[spoken]
        )
        aside = position[spoken[speaker], :2] - position[:, :2]  # all point to the same centre
        return Perception(
            windows, points, frame, position,
            foreground[speaker], dynamic[speaker], offset[speaker] + aside,
            seconds, speaker, feature, own_base,
        )  # fmt: skip

    def track(self, perception: Perception, instance: torch.Tensor) -> ObjectMotions:
        """Proposed motions of objects whose points the caller knows.

        Args:
            perception: Of the windows.
            instance: (Q,) int64 ids, 0 for none; an id belongs to one window only.
        """
        chosen = torch.nonzero(instance > 0)[:, 0]
        ids, row = torch.unique(instance[chosen], return_inverse=True)
        device = instance.device
        lengths = perception.windows.lengths
        firsts = [sum(lengths[:window]) for window in range(len(lengths))]
        first = torch.tensor(firsts, device=device)
        target = torch.tensor(perception.windows.target, device=device) - first
        of_frame = torch.tensor(perception.windows.of_frame, device=device)
        frame = perception.frame[chosen]
        time = frame - first[of_frame[frame]]
        window = torch.zeros_like(ids).index_copy(0, row, of_frame[frame])
        shown = torch.arange(len(chosen), device=device)
        if self.settings.tube == "sides":
            slot = row * max(lengths) + time
            shown = one_of_each_cell(perception.position[chosen], slot, TUBE_CELL_M)
        asked = chosen[shown]
        tubes = gather_tubes(
            perception.position[asked],
            row[shown],
            time[shown],
            perception.seconds[asked],
            target[window],
            len(ids),
        )
        motions = self.tube_net(tubes, perception.features_of(asked), perception.base_of(asked))
        return ObjectMotions(
            ids=ids,
            window=window,
            instance=row,
            time=time,
            tubes=tubes,
            motions=motions,
            target_from_aligned=about(motions.anchor_from_time[-1], -tubes.anchor[:, None]),
        )


def presence_map(features: FrameFeatures) -> torch.Tensor:
    """(F, 1, S, S) probability of foreground in occupied pillars, 0 elsewhere; no gradient."""
    frames = features.frames
    maps = features.foreground.new_zeros(len(frames), 1, frames.cells, frames.cells)
    chance = features.foreground.detach().sigmoid()
    return maps.view(-1).index_copy(0, frames.pillar_place, chance).view_as(maps)


def build_network(settings: NetworkSettings | None = None, seed: int = 0) -> Network:
    """A network of these settings with fresh weights that depend on the seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = Network(settings)
    channels_last(network)
    return network
