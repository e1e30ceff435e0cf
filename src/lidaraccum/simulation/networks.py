"""Road networks by scene kind, drawn by seed, with the ego's way through them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.roads import Lane, Network, Path, Road, circle, joined, straight, winding

BEHIND_M = 110.0
"""Road laid behind the ego's start, and beyond its last place."""
SIDE_M = 100.0
"""Length of side roads."""
NOWHERE: NDArray[np.float64] = np.zeros((0, 3))

SLOW_KINDS = ("straight", "curved", "crossing", "roundabout", "square", "suburban")
FAST_KINDS = ("highway", "rural", "straight", "tunnel", "bridge")
SCENE_KINDS = (*SLOW_KINDS, "rural", "highway", "tunnel", "bridge", "industrial")
"""Every kind of scene."""


def draw_kind(speed_mps: float, rng: np.random.Generator) -> str:
    """A kind of scene in which such a speed occurs."""
    if speed_mps > 16:
        return str(rng.choice(FAST_KINDS))
    weights = np.array([2, 2, 3, 1, 1.5, 3, 1, 0.3 if speed_mps < 8 else 0.6, 0.5, 0.5, 1.5])
    return str(rng.choice(SCENE_KINDS, p=weights / weights.sum()))


def lay_network(kind: str, reach_m: float, rng: np.random.Generator) -> Network:
    """The roads of a scene.

    Args:
        kind: One of ``SCENE_KINDS``.
        reach_m: How far the ego will drive, metres.
        rng: What is drawn comes from here.
    """
    hand = 1 if rng.random() < 0.75 else -1
    layers: dict[str, Callable[..., Network]] = {
        "crossing": _crossing,
        "roundabout": _roundabout,
        "square": _square,
    }
    layer = layers.get(kind, _single)
    return layer(kind, reach_m, hand, rng)


def _centre_line(kind: str, reach_m: float, rng: np.random.Generator) -> Path:
    """The main road's middle; the ego starts at the origin, heading along x."""
    behind, ahead = int(BEHIND_M), int(reach_m + BEHIND_M) + 1
    sharpest = {"curved": 1 / 28, "suburban": 1 / 60, "rural": 1 / 90, "square": 1 / 120}.get(
        kind, 1 / 1500
    )
    if kind in ("highway", "tunnel", "bridge"):
        sharpest = 1 / 350
    count = behind + ahead
    knots = np.arange(0, count + 40, 25.0)
    bends = sharpest * rng.uniform(-1, 1, len(knots)) * rng.uniform(0.3, 1.0)
    if kind == "curved":
        bends = np.sign(rng.uniform(-1, 1)) * np.abs(bends)
        bends[np.abs(knots - behind - rng.uniform(-10, 60)) > 45] *= 0.1
    curvature = np.interp(np.arange(count), knots, bends)
    forth = winding(np.zeros(2), 0.0, curvature[behind:])
    back = winding(np.zeros(2), np.pi, -curvature[:behind][::-1])
    return Path(np.concatenate([back.points[::-1], forth.points[1:]]))


def _main_road(kind: str, centre: Path, rng: np.random.Generator) -> Road:
    if kind == "highway":
        return Road(centre, int(rng.integers(2, 4)), 3.6, 2.5 * (rng.random() < 0.5), 0.0, 27.0)
    if kind in ("rural", "tunnel", "bridge"):
        lanes = 1 if kind == "rural" else int(rng.integers(1, 3))
        walk = 0.0 if kind == "rural" else float(rng.choice([0.0, 1.5]))
        return Road(centre, lanes, float(rng.uniform(2.8, 3.6)), 0.0, walk, rng.uniform(13, 24))
    lanes = 1 if kind in ("suburban", "curved") or rng.random() < 0.6 else 2
    parking = float(rng.choice([0.0, 2.2, 2.2, 2.3, 5.2]))
    walk = float(rng.choice([0.0, 1.5, 2.5, 3.5, 5.0], p=[0.1, 0.2, 0.35, 0.25, 0.1]))
    return Road(centre, lanes, rng.uniform(2.6, 3.5), parking, walk, rng.uniform(7, 15))


def _side_road(centre: Path, rng: np.random.Generator) -> Road:
    parking = float(rng.choice([0.0, 2.2]))
    walk = float(rng.choice([0.0, 2.0, 3.0]))
    return Road(centre, 1, rng.uniform(2.6, 3.4), parking, walk, rng.uniform(6, 12))


def _lanes_of(road: Road, hand: int) -> list[Lane]:
    """All lanes of a road, the ego's own (forward, innermost) first."""
    speeds = [road.speed_mps * (1 - 0.12 * index) for index in range(road.lanes)]
    forward = [Lane(road.lane(index, hand), speed) for index, speed in enumerate(speeds)]
    return forward + [Lane(road.oncoming(index, hand), speed) for index, speed in enumerate(speeds)]


def _single(kind: str, reach_m: float, hand: int, rng: np.random.Generator) -> Network:
    centre = _centre_line(kind, reach_m, rng)
    road = _main_road(kind, centre, rng)
    roads, lanes = [road], _lanes_of(road, hand)
    if kind in ("suburban", "straight", "industrial") and rng.random() < 0.6:
        side = _branch(centre, rng.uniform(BEHIND_M - 40, BEHIND_M + reach_m + 60), rng)
        roads.append(_side_road(side, rng))
        lanes += _lanes_of(roads[-1], hand)
    own = int(rng.integers(road.lanes))
    sharpest = float(np.max(np.abs(np.gradient(centre.headings))))
    limit = float(np.sqrt(3.5 / max(sharpest, 1e-3)))
    return Network(
        kind, tuple(roads), _own_first(lanes, own), lanes[own].path, BEHIND_M, hand, NOWHERE,
        NOWHERE, limit,
    )  # fmt: skip


def _own_first(lanes: list[Lane], own: int) -> tuple[Lane, ...]:
    return (lanes[own], *lanes[:own], *lanes[own + 1 :])


def _branch(centre: Path, along: float, rng: np.random.Generator) -> Path:
    place, heading = centre.at(along)
    side = float(rng.choice([-1, 1]))
    turn = heading + side * rng.uniform(np.deg2rad(65), np.deg2rad(115))
    return straight(place, float(turn), SIDE_M)


def _crossing(kind: str, reach_m: float, hand: int, rng: np.random.Generator) -> Network:
    """A road crossed by another; the ego goes straight over or turns."""
    main = _main_road(kind, _centre_line(kind, reach_m, rng), rng)
    along = BEHIND_M + rng.uniform(8, 30 + 0.8 * reach_m)
    place, heading = main.centre.at(along)
    turn = float(heading) + rng.uniform(np.deg2rad(60), np.deg2rad(120))
    start = place - SIDE_M * np.array([np.cos(turn), np.sin(turn)])
    across = _side_road(straight(start, turn, 2 * SIDE_M + reach_m), rng)
    lanes = _lanes_of(main, hand) + _lanes_of(across, hand)
    into, out, back = lanes[0].path, across.lane(0, hand), across.oncoming(0, hand)
    inner, outer = main.half_m + 4, across.half_m + 4
    before = into.part(0, into.nearest(place) - outer)
    turns = [
        joined([before, out.part(out.nearest(place) + inner, out.length)]),
        joined([before, back.part(back.nearest(place) + inner, back.length)]),
    ]
    lanes += [Lane(path, 6.0) for path in turns]
    choice = int(rng.integers(4))
    ego, limit = (turns[choice], 7.0) if choice < 2 else (into, 40.0)
    lanes.insert(0, Lane(ego, lanes[0].speed_mps))
    return Network(kind, (main, across), tuple(lanes), ego, BEHIND_M, hand, NOWHERE, NOWHERE, limit)


def _roundabout(kind: str, reach_m: float, hand: int, rng: np.random.Generator) -> Network:
    """A ring with three or four arms; the ego comes in and leaves by another arm."""
    radius = float(rng.uniform(12, 22))
    centre = np.array([radius + rng.uniform(6, 20 + 0.5 * reach_m), 0.0])
    ring_road = Road(circle(centre, radius, 0, 2 * np.pi), 1, 3.2, 0.0, 0.0, 7.0)
    count = int(rng.integers(3, 5))
    angles = np.pi + 2 * np.pi * np.arange(count) / count + rng.uniform(-0.2, 0.2, count)
    angles[0] = np.pi
    arms, inbound, outbound = [], [], []
    for angle in angles:
        ahead = np.array([np.cos(angle), np.sin(angle)])
        start = centre + (radius + 1) * ahead
        road = _side_road(straight(start, float(angle), BEHIND_M + 40), rng)
        arms.append(road)
        outbound.append(road.lane(0, hand).part(9, BEHIND_M + 39))
        inbound.append(road.oncoming(0, hand).part(0, BEHIND_M + 31))
    ways = [
        _through_ring(centre, radius, inbound[first], outbound[last], hand)
        for first in range(count)
        for last in range(count)
        if first != last
    ]
    ego = ways[int(rng.integers(count - 1))]
    lanes = [Lane(ego, 7.0)] + [Lane(way, 7.0) for way in ways if way is not ego]
    islands = np.array([[*centre, radius - 3.2]])
    begin = ego.nearest(np.zeros(2))
    return Network(kind, (ring_road, *arms), tuple(lanes), ego, begin, hand, NOWHERE, islands, 7.5)


def _through_ring(
    centre: NDArray[np.float64], radius: float, into: Path, out: Path, hand: int
) -> Path:
    """In by one arm, round the ring (anticlockwise when traffic keeps right), out by another."""
    enter, leave = into.points[-1] - centre, out.points[0] - centre
    first = np.arctan2(enter[1], enter[0]) + hand * 0.35
    last = np.arctan2(leave[1], leave[0]) - hand * 0.35
    turn = hand * (np.mod(hand * (last - first), 2 * np.pi))
    return joined([into, circle(centre, radius, float(first), float(turn)), out])


def _square(kind: str, reach_m: float, hand: int, rng: np.random.Generator) -> Network:
    """A road along or across an open paved place."""
    network = _single("square", reach_m, hand, rng)
    along = BEHIND_M + rng.uniform(-10, 30 + 0.5 * reach_m)
    radius = float(rng.uniform(22, 45))
    middle, _ = network.roads[0].centre.at(along, rng.uniform(-1, 1) * radius)
    return Network(
        kind, network.roads, network.lanes, network.ego, BEHIND_M, hand,
        np.array([[*middle, radius]]), NOWHERE, network.ego_speed_limit,
    )  # fmt: skip
