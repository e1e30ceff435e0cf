"""Who moves: vehicles in lanes, cyclists, walkers, manoeuvres, and things that have no class."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.actors import Actor, Way, follow
from lidaraccum.simulation.ego import Ego
from lidaraccum.simulation.lanes import Column, drive_column
from lidaraccum.simulation.models import Model
from lidaraccum.simulation.motion import distance_of, speed_profile
from lidaraccum.simulation.roads import Lane, Path, Road, straight
from lidaraccum.simulation.world import World

Array = NDArray[np.float64]

LANE_CHANCES = {"car": 20.0, "van": 3.0, "truck": 2.0, "bus": 1.0, "motorcyclist": 1.2,
                "oddity": 0.25, "tram": 0.2}  # fmt: skip
FAST_CHANCES = {"car": 16.0, "van": 3.0, "truck": 5.0, "bus": 0.6, "motorcyclist": 0.5}
EDGE_CHANCES = {"cyclist": 8.0, "kick_scooter": 1.0, "motorcyclist": 0.5, "oddity": 0.5}
WALK_CHANCES = {"pedestrian": 12.0, "child": 2.0, "kick_scooter": 0.5, "dog": 0.8, "pram": 0.8,
                "cyclist": 0.8, "oddity": 0.6}  # fmt: skip
WALKERS = {"straight": 1.0, "crossing": 1.4, "square": 2.2, "curved": 0.8, "roundabout": 0.6,
           "suburban": 0.6, "industrial": 0.4, "bridge": 0.3, "tunnel": 0.2, "rural": 0.15,
           "highway": 0.0}  # fmt: skip
EGO_LENGTH_M = 4.6
SHORT_S = 2.5
"""In drives longer than this movers come from beyond the ground and leave it again."""
PROBE_S = 0.25
"""Movers are kept apart at times no further apart than this."""


class Traffic:
    """Fills a world with movers that keep clear of each other and of what stands.

    Args:
        world: Where.
        ego: Keeps its own way free.
        rng: What is drawn comes from here.
    """

    def __init__(self, world: World, ego: Ego, rng: np.random.Generator) -> None:
        self.world = world
        self.rng = rng
        self.times = ego.trajectory.times
        self.ego = ego
        self.actors: list[Actor] = []
        lasts = float(self.times[-1] - self.times[0])
        probes = max(12, int(lasts / PROBE_S))
        self._probe = np.unique(np.linspace(0, len(self.times) - 1, probes).astype(int))
        self.extra_s = max(lasts - SHORT_S, 0.0)
        middle = ego.trajectory.places[self._probe, :2]
        yaw = ego.trajectory.angles[self._probe, 0]
        self._taken = [_discs(middle, yaw, EGO_LENGTH_M, 2.2)]
        self.busy = float(rng.beta(1.6, 1.6))
        gone = float(ego.trajectory.travelled[-1] - ego.trajectory.travelled[0])
        self._stretch = 1.0 + gone / 60.0 if self.extra_s else 1.0
        self.focus = ego.trajectory.places[len(self.times) // 2, :2]

    def populate(self) -> tuple[Actor, ...]:
        """Everything that has a trajectory; ids follow those of the parked things."""
        network = self.world.network
        jam = self.rng.random() < 0.12
        for index, lane in enumerate(network.lanes):
            self._lane(lane, own=index == 0, jam=jam and self.rng.random() < 0.6)
        for road in network.roads:
            self._edges(road)
            self._walks(road)
        self._squares()
        self._parking()
        return tuple(self.actors)

    # -- admission --

    def admit(self, model: Model, way: Way, margin: float = 0.25, *, on_road: bool = True) -> bool:
        """Let a mover in, unless it would touch another one or, off the road, what stands."""
        world = self.world
        trajectory = follow(way, model, self.times, world.terrain)
        places, yaw = trajectory.places[self._probe, :2], trajectory.angles[self._probe, 0]
        covered = world.terrain.covers(places, 4.0)
        if not (covered.any() if self.extra_s else covered.all()):
            return False
        discs = _discs(places, yaw, model.size_lwh[0], model.size_lwh[1])
        for other in self._taken:
            gap = np.linalg.norm(discs[:, :, None, :2] - other[:, None, :, :2], axis=3)
            if np.any(gap < discs[:, :, None, 2] + other[:, None, :, 2] + margin):
                return False
        if self._touches_standing(discs, 0.0 if on_road else margin):
            return False
        self._taken.append(discs)
        number = len(world.stills) + len(self.actors) + 1
        self.actors.append(Actor(number, model, trajectory))
        return True

    def _touches_standing(self, discs: Array, margin: float) -> bool:
        flat, standing = discs.reshape(-1, 3), self.world.discs
        low, high = flat[:, :2].min(axis=0) - 4, flat[:, :2].max(axis=0) + 4
        near = standing[np.all((standing[:, :2] > low) & (standing[:, :2] < high), axis=1)]
        if not len(near):
            return False
        gap = np.linalg.norm(flat[:, None, :2] - near[None, :, :2], axis=2)
        return bool(np.any(gap < flat[:, None, 2] + near[None, :, 2] + margin))

    # -- lanes --

    def _lane(self, lane: Lane, *, own: bool, jam: bool) -> None:
        """Vehicles following each other; in the ego's lane, ahead of it and behind it."""
        if own:
            self._own_lane(lane)
            return
        rng, path = self.rng, lane.path
        inside = np.flatnonzero(self.world.terrain.covers(path.points, 3.0))
        if len(inside) < 10:
            return
        first, last = path.arc[inside[0]], path.arc[inside[-1]]
        speed = 0.0 if jam else lane.speed_mps * rng.uniform(0.7, 1.15)
        starts, models, along = [], [], last - rng.uniform(2, 30)
        sparse = 38 / (0.15 + self.busy)
        while along > first + 6 - speed * self.extra_s:
            model = self._vehicle(lane.speed_mps)
            if along - 0.5 * model.size_lwh[0] > first - speed * self.extra_s:
                starts.append(along - 0.5 * model.size_lwh[0])
                models.append(model)
            gap = (
                rng.uniform(1.5, 5)
                if jam
                else 3 + speed * rng.uniform(0.7, 1.8) + rng.exponential(sparse)
            )
            along -= model.size_lwh[0] + gap
        if models:
            self._column(lane, models, np.array(starts), speed, None, 0.0, jam=jam)

    def _vehicle(self, speed: float) -> Model:
        return self.world.catalogue.draw_any(FAST_CHANCES if speed > 18 else LANE_CHANCES)

    def _column(
        self, lane: Lane, models: list[Model], starts: Array, speed: float,
        leader: Array | None, leader_m: float, *, jam: bool = False,
    ) -> None:  # fmt: skip
        rng, count = self.rng, len(models)
        speeds = np.full(count, speed) * rng.uniform(0.95, 1.05, count)
        waits = rng.uniform(0, 2.0 * float(self.times[-1]), count) if jam else np.zeros(count)
        column = Column(
            starts, speeds, np.maximum(speeds, lane.speed_mps) * rng.uniform(0.95, 1.1, count),
            np.array([model.size_lwh[0] for model in models]), rng.uniform(0.7, 1.6, count), waits,
        )  # fmt: skip
        track = drive_column(column, self.times, leader, leader_m)
        for model, along in zip(models, track.T, strict=True):
            self.admit(model, Way(lane.path, along, self._weave(0.15)))

    def _weave(self, size: float) -> Array:
        """A lateral (K,) that wanders slowly; now and then a change of lane."""
        rng = self.rng
        period, phase = rng.uniform(5, 12), rng.uniform(0, 2 * np.pi)
        return rng.normal(0, size) + 0.5 * size * np.sin(2 * np.pi * self.times / period + phase)

    def _own_lane(self, lane: Lane) -> None:
        rng, network = self.rng, self.world.network
        own = network.ego_start + self.ego.trajectory.travelled
        speed = float(self.ego.speeds[0])
        ahead, factor, nose = own.copy(), 1.0, 0.5 * EGO_LENGTH_M
        offset = 0.0
        for _ in range(4):
            model = self._vehicle(max(speed, lane.speed_mps))
            offset += (
                nose
                + 0.5 * model.size_lwh[0]
                + 3
                + speed * rng.uniform(0.6, 2.0)
                + rng.exponential(12 / (0.2 + self.busy))
            )
            factor *= 1 + abs(rng.normal(0, 0.03))
            ahead = own[0] + offset + factor * (own - own[0])
            if rng.random() < 0.3 + 0.7 * self.busy:
                self.admit(model, Way(lane.path, ahead, self._weave(0.15)))
            nose = 0.5 * model.size_lwh[0]
        starts, models, along = [], [], float(own[0]) - 0.5 * EGO_LENGTH_M
        for _ in range(4):
            model = self._vehicle(max(speed, lane.speed_mps))
            along -= (
                3
                + speed * rng.uniform(0.7, 2.0)
                + rng.exponential(12 / (0.2 + self.busy))
                + model.size_lwh[0]
            )
            starts.append(along + 0.5 * model.size_lwh[0])
            models.append(model)
        pace = Lane(lane.path, max(speed, 1.0))
        self._column(pace, models, np.array(starts), speed, own, EGO_LENGTH_M)

    # -- beside the lanes --

    def _near(self, path: Path, spread: float = 45.0) -> float:
        """Metres along a path of some place not far from the ego."""
        focus = self.focus
        if self.extra_s:
            focus = self.ego.trajectory.places[self.rng.integers(len(self.times)), :2]
        return path.nearest(focus) + self.rng.normal(0, 0.5) * spread

    def _edges(self, road: Road) -> None:
        """Cyclists and the like at the right edge of the lanes, and overtakers."""
        rng, hand = self.rng, self.world.network.hand
        count = rng.poisson((1.2 * self.busy + 0.2) * self._stretch) if road.speed_mps < 20 else 0
        for _ in range(count):
            away = bool(rng.random() < 0.5)
            lateral = hand * (road.drive_m - rng.uniform(0.4, 0.9))
            path = road.centre.beside(-lateral) if away else road.centre.beside(lateral).reversed
            speeds = speed_profile(self.times, rng.uniform(2.5, 7.5), "cruise", rng)
            along = self._near(path) + distance_of(self.times, speeds)
            model = self.world.catalogue.draw_any(EDGE_CHANCES)
            self.admit(model, Way(path, along, self._weave(0.12)))
        if rng.random() < 0.3:
            self._overtake(road)

    def _overtake(self, road: Road) -> None:
        """One vehicle passing from one lane into the next."""
        rng, hand = self.rng, self.world.network.hand
        path = road.lane(0, hand) if rng.random() < 0.5 else road.oncoming(0, hand)
        speeds = speed_profile(
            self.times, road.speed_mps * rng.uniform(1.0, 1.3), "accelerate", rng
        )
        along = self._near(path) + distance_of(self.times, speeds)
        begins, takes = rng.uniform(-2, self.times[-1]), rng.uniform(2.5, 4)
        share = np.clip((self.times - begins) / takes, 0, 1)
        lateral = hand * rng.choice([-1, 1]) * road.lane_m * share**2 * (3 - 2 * share)
        self.admit(self._vehicle(road.speed_mps), Way(path, along, lateral))

    def _walks(self, road: Road) -> None:
        """People along pavements and across the road."""
        rng, kind = self.rng, self.world.network.kind
        count = rng.poisson(WALKERS[kind] * (0.8 + 4 * self.busy) * self._stretch)
        for _ in range(count):
            if rng.random() < 0.25:
                self._cross(road)
                continue
            side, walk = float(rng.choice([-1, 1])), max(road.walk_m, 1.0)
            lateral = side * (road.half_m + rng.uniform(0.7, max(walk - 0.4, 0.9)))
            path = road.centre.beside(lateral)
            path = path if rng.random() < 0.5 else path.reversed
            self._stroll(path, self._near(path), int(rng.choice([1, 1, 2, 3])))

    def _stroll(self, path: Path, start: float, company: int) -> None:
        """One or a few walking side by side."""
        rng = self.rng
        pace = float(np.clip(rng.normal(1.35, 0.35), 0.6, 4.0)) * (
            2.2 if rng.random() < 0.07 else 1
        )
        for index in range(company):
            model = self.world.catalogue.draw_any(WALK_CHANCES)
            speeds = speed_profile(self.times, pace, "cruise", rng)
            along = start + rng.normal(0, 0.4) + distance_of(self.times, speeds)
            lateral = self._weave(0.08) + 0.75 * (index - 0.5 * (company - 1))
            self.admit(model, Way(path, along, lateral), 0.02, on_road=False)

    def _cross(self, road: Road) -> None:
        rng = self.rng
        place, heading = road.centre.at(self._near(road.centre))
        turn = float(heading) + rng.choice([-1, 1]) * rng.uniform(1.2, 1.9)
        reach = road.half_m + 3
        path = straight(place - reach * np.array([np.cos(turn), np.sin(turn)]), turn, 2 * reach)
        self._stroll(path, rng.uniform(0.5, 2 * reach - 1), int(rng.choice([1, 1, 2])))

    def _squares(self) -> None:
        """Across open squares, parks and yards, in any direction."""
        rng, network = self.rng, self.world.network
        spots = [
            square for square in network.squares for _ in range(rng.poisson(4 + 10 * self.busy))
        ]
        loose = rng.poisson(2.0 * WALKERS[network.kind] * self.busy)
        spots += [np.array([*self.focus, 35.0]) for _ in range(loose)]
        for x, y, radius in spots:
            start = np.array([x, y]) + rng.uniform(-0.8, 0.8, 2) * radius
            path = straight(start, rng.uniform(0, 2 * np.pi), 20.0)
            self._stroll(path, 0.0, int(rng.choice([1, 1, 2])))

    def _parking(self) -> None:
        """Cars that pull out, back out of a bay, or manoeuvre slowly off the road."""
        rng, network = self.rng, self.world.network
        for _ in range(rng.poisson((0.8 + 0.8 * self.busy) * self._stretch)):
            road = network.roads[int(rng.integers(len(network.roads)))]
            place, heading = road.centre.at(self._near(road.centre, 30.0))
            side = float(rng.choice([-1, 1]))
            left = np.array([-np.sin(heading), np.cos(heading)])
            start = place + side * (road.half_m + rng.uniform(-1.0, 7)) * left
            turn = float(heading) + rng.uniform(0.6, 2.5) * -side
            bend = rng.uniform(-1, 1) / 7
            path = _arc(start, turn, bend, 14.0)
            speeds = speed_profile(
                self.times,
                rng.uniform(0.7, 3),
                str(rng.choice(["cruise", "pull away", "brake"])),
                rng,
            )
            along = 1.0 + distance_of(self.times, speeds)
            model = self.world.catalogue.draw_any({"car": 8, "van": 1, "oddity": 1})
            self.admit(model, Way(path, along, np.zeros(len(along)), bool(rng.random() < 0.5)))


def _arc(start: Array, heading: float, bend: float, length: float) -> Path:
    headings = heading + bend * np.arange(int(length))
    steps = np.stack([np.cos(headings), np.sin(headings)], axis=1)
    return Path(np.concatenate([start[None], start + np.cumsum(steps, axis=0)]))


def _discs(places: Array, yaw: Array, length: float, width: float) -> Array:
    """(P, D, 3) discs that cover a rectangle at each of P places."""
    radius = 0.5 * min(length, width) * 1.05
    count = int(np.clip(np.ceil(length / max(width, 0.3)), 1, 7))
    along = (
        np.linspace(-0.5, 0.5, count) * max(length - 2 * radius, 0.0) if count > 1 else np.zeros(1)
    )
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    discs = np.empty((len(places), count, 3))
    discs[:, :, :2] = places[:, None] + along[:, None] * ahead[:, None]
    discs[:, :, 2] = radius
    return discs
