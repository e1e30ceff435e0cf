"""The network's four verbs: encode a frame, match two, perceive a window, track its objects."""

from __future__ import annotations

from typing import cast

import torch
from torch import nn

from lidaraccum.model.answers import FrameFeatures, ObjectMotions, Perception
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
from lidaraccum.model.tube_net import TubeNet
from lidaraccum.model.tubes import gather_tubes, one_of_each_cell
from lidaraccum.model.unet import UNet, channels_last, convolution, to_one_channel

MOST_POINTS = 200_000
"""So many points of a window are looked at closely by those who bound their time: dense sensors,
and weights that take everything for movable, would have many more."""

TUBE_CELL_M = 0.15
"""TubeNet sees one of an object's points in each cell; the paper thins points like this too."""

RARE = -2.0
"""Logit that foreground starts from: most pillars hold none."""


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
            points: (Q,) int64, ascending: the points to look at; what `choose` says when None.
            most: Read about so many; of more, every second or third of a pillar, which speaks for
                those above it up to the next. 0 for all.
            detach: Keep the motion branch's gradient out of the base features.
        """
        view = self.view(features, target_from_frame, windows, detach=detach)
        return self.look(view, self.choose(view, features) if points is None else points, most)

    def view(
        self,
        features: FrameFeatures,
        target_from_frame: torch.Tensor,
        windows: Windows,
        *,
        detach: bool = False,
    ) -> View:
        """The dear half of `perceive`: the windows' motion maps, to look at points with."""
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
        return View(frames, windows, base, motion_map, level)

    def choose(self, view: View, features: FrameFeatures) -> torch.Tensor:
        """The points (Q,) int64, ascending, that are worth a closer look."""
        odds = self.settings.glance_odds, self.settings.beside_odds
        return view.choose(self.point_head, features.foreground, *odds)

    def look(self, view: View, points: torch.Tensor, most: int = 0) -> Perception:
        """The cheap half of `perceive`: what is said of points (Q,) int64, ascending."""
        frame, position, seconds = view.place(points)
        every = len(points) // most + 1 if most else 1
        spoken, speaker = speakers_of(view.frames.pillar[points], every)
        feature, foreground, dynamic, offset, own_base = view.ask(
            self.point_head, points[spoken], frame[spoken], position[spoken], seconds[spoken]
        )
        aside = position[spoken[speaker], :2] - position[:, :2]  # all point to the same centre
        return Perception(
            view.windows, points, frame, position,
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
