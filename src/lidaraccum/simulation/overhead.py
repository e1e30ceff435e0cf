"""What spans a road: tunnels, bridges over it, bridge decks with parapets, wires on poles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Finish, Mesh, box, grid, lathe, merge, rod
from lidaraccum.simulation.plot import Plot
from lidaraccum.simulation.roads import Road
from lidaraccum.simulation.surfaces import Surface

Array = NDArray[np.float64]
POLE = Finish(Surface.POLE, 0.35)


def build_overhead(plot: Plot, kind: str, start: float) -> None:
    """Spans and wires of a scene; ``start`` is where the ego starts along the main road."""
    road, rng = plot.network.roads[0], plot.rng
    if kind == "tunnel":
        _tunnel(plot, road, start + rng.uniform(-60, 15), rng.uniform(40, 120))
    elif kind == "bridge" or (kind in ("highway", "straight") and rng.random() < 0.2):
        _overpass(plot, road, start + rng.uniform(8, 60))
    if rng.random() < {"rural": 0.6, "suburban": 0.4}.get(kind, 0.15):
        _wires(plot, road)


def _section(plot: Plot, road: Road, along: Array, lateral: Array, height: Array) -> Array:
    """(S, K, 3) points at metres along (S,), each at laterals and heights (K,) above the road."""
    places = np.stack([road.centre.at(along, np.full(len(along), one))[0] for one in lateral], 1)
    ground = plot.terrain.height(road.centre.at(along)[0])
    return np.concatenate([places, (ground[:, None] + height)[..., None]], axis=2)


def _tunnel(plot: Plot, road: Road, start: float, length: float) -> None:
    rng = plot.rng
    half, high = road.half_m + road.walk_m + rng.uniform(0.3, 1.5), rng.uniform(4.6, 6.5)
    end = min(start + length, road.centre.length - 5)
    along = np.arange(max(start, 2), end, 4.0)
    if len(along) < 2:
        return
    if rng.random() < 0.5:
        angle = np.linspace(0, np.pi, 9)
        lateral, height = half * np.cos(angle), 1.5 + (high - 1.5) * np.sin(angle)
        lateral, height = np.r_[half, lateral, -half], np.r_[-0.3, height, -0.3]
    else:
        lateral, height = np.array([half, half, -half, -half]), np.array([-0.3, high, high, -0.3])
    finish = Finish(Surface.WALL, float(rng.uniform(0.15, 0.5)))
    plot.parts.append(grid(_section(plot, road, along, lateral, height), finish))
    for side in (-1, 1):
        plot.take(road.centre.at(along, side * (half + 3.0))[0], 3.0)


def _overpass(plot: Plot, road: Road, along: float) -> None:
    rng = plot.rng
    place, heading = road.centre.at(along)
    high, deck = rng.uniform(4.8, 6.5), rng.uniform(6, 14)
    reach = road.half_m + road.walk_m + 14
    finish = Finish(Surface.WALL, float(rng.uniform(0.2, 0.5)))
    parts = [
        box((deck, 2 * reach, 1.0), (0, 0, high), finish),
        *(box((0.25, 2 * reach, 1.0), (s * 0.5 * deck, 0, high + 1), finish) for s in (-1, 1)),
    ]
    stand = road.half_m + road.walk_m + 0.8
    piers = [(x, s * stand) for x in (-0.35 * deck, 0.0, 0.35 * deck) for s in (-1, 1)]
    solid = rng.random() < 0.4
    for x, y in piers:
        parts.append(lathe([(0.45, -1), (0.45, high)], finish, 8).moved((x, y, 0)))
    if solid:
        parts += [box((deck, 0.6, high + 1), (0, s * (stand + 0.6), -1), finish) for s in (-1, 1)]
    yaw = float(heading) + rng.uniform(-0.3, 0.3)
    height = float(plot.terrain.height(place[None])[0])
    plot.parts.append(merge(parts).moved((float(place[0]), float(place[1]), height), yaw))
    sides = road.centre.at(np.linspace(along - deck / 2, along + deck / 2, 5), stand)[0]
    others = road.centre.at(np.linspace(along - deck / 2, along + deck / 2, 5), -stand)[0]
    plot.take(np.concatenate([sides, others]), 1.2)


def _wires(plot: Plot, road: Road) -> None:
    """Poles along one side, and slack wires between them."""
    rng = plot.rng
    side, gap = float(rng.choice([-1, 1])), rng.uniform(25, 45)
    lateral = side * (road.half_m + road.walk_m + rng.uniform(0.6, 3))
    along = np.arange(5, road.centre.length - 5, gap)
    places, _ = road.centre.at(along, np.full(len(along), lateral))
    keep = plot.off_road(places, 0.5)
    places = places[keep]
    high = rng.uniform(6, 9)
    ground = plot.terrain.height(places) if len(places) else np.zeros(0)
    tops = np.concatenate([places, (ground + high)[:, None]], axis=1)
    parts: list[Mesh] = []
    for top in tops:
        parts.append(lathe([(0.14, -high - 0.3), (0.09, 0.4)], POLE, 8).moved(tuple(top)))
    plot.take(places, 0.3)
    for first, last in pairwise(tops):
        if np.linalg.norm(last - first) > 1.5 * gap:
            continue
        share = np.linspace(0, 1, 7)[:, None]
        sag = np.array([0.0, 0.0, -1.0]) * 4 * share * (1 - share) * rng.uniform(0.3, 1.2)
        cable = first + share * (last - first) + sag
        parts += [rod(a, b, 0.015, POLE) for a, b in pairwise(cable)]
    plot.parts.append(merge(parts))
