"""Large things right beside the ego's way: what stands within a few metres fills most of a frame.

A lorry at two metres is a wall to the sensor, and a wall at two metres a lorry: what tells them
apart (wheels, what is seen below and above, where it ends) is learned from many of both. Set last,
and drawn from a generator of its own, so that nothing else in a world moves by it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.barriers import BARRIERS
from lidaraccum.simulation.buildings import draw_building
from lidaraccum.simulation.furniture import (
    FURNITURE,
    billboard,
    bus_stop,
    container,
    kiosk,
)
from lidaraccum.simulation.growth import wild_hedge
from lidaraccum.simulation.mesh import Finish, Mesh, box
from lidaraccum.simulation.roads import Path
from lidaraccum.simulation.site import Maker, Site
from lidaraccum.simulation.surfaces import Surface
from lidaraccum.simulation.vegetation import hedge

Array = NDArray[np.float64]

MOVABLE = {"truck": 5.0, "bus": 2.5, "trailer": 2.0, "van": 2.0, "car": 4.0, "tram": 0.4}
GAPS_M = (0.2, 2.5)
"""Between the ego's body and what stands beside it."""
EGO_HALF_M = 1.1
EVERY_M = 20.0
AHEAD_M, BEHIND_M = 14.0, 8.0
"""Of the stretch that the ego drives, they stand so far beyond its ends too."""
LONGER_M, TALLER_M = 5.5, 2.4
"""What cannot move is the one or the other: what is as large as a car and near should be a car."""

ANYWHERE_M = -50.0
"""A margin to the carriageway that lets things stand on it."""


def pier(rng: np.random.Generator) -> Mesh:
    """A pier, a portal's foot, a stub of a wall: plain, upright, of any length."""
    size = (rng.uniform(0.5, 9.0), rng.uniform(0.3, 2.5), rng.uniform(1.2, 6.0))
    return box(size, (0, 0, 0), Finish(Surface.WALL, float(rng.uniform(0.15, 0.6))))


def house_front(rng: np.random.Generator) -> Mesh:
    """A house or a low building that stands out to the road, about the origin."""
    width, depth = rng.uniform(3.0, 14.0), rng.uniform(2.5, 6.0)
    house = draw_building(width, depth, int(rng.integers(1, 4)), rng)
    return house.moved((0.0, -0.5 * depth, 0.0))


STANDING: tuple[Maker, ...] = (container, kiosk, bus_stop, billboard, pier, house_front)
LINES = (BARRIERS["wall"], BARRIERS["noise_wall"], BARRIERS["boards"], hedge, wild_hedge)


def crowd(site: Site, way: Path, stretch: tuple[float, float], much: float) -> None:
    """Set large things beside the way, movable and not, as many of either.

    Args:
        site: What is built on; all draws come from its generator.
        way: Where the ego drives.
        stretch: From where to where, metres along the way.
        much: So many on every 20 m, on average.
    """
    rng = site.rng
    first, last = stretch[0] - BEHIND_M, stretch[1] + AHEAD_M
    for _ in range(rng.poisson(much * (last - first) / EVERY_M)):
        along, side, lot = rng.uniform(first, last), float(rng.choice([-1, 1])), rng.random()
        gap = EGO_HALF_M + rng.uniform(*GAPS_M)
        if lot < 0.5:
            _leave(site, way, along, side * gap)
        elif lot < 0.9:
            _stand(site, way, along, side * gap)
        else:
            _line(site, way, along, side * gap)


def _leave(site: Site, way: Path, along: float, lateral: float) -> None:
    """Something movable, along the way, either way round, now and then askew."""
    rng = site.rng
    model = site.catalogue.draw_any(MOVABLE)
    length, width, _ = model.size_lwh
    place, heading = way.at(along, lateral + np.sign(lateral) * 0.5 * width)
    yaw = float(heading) + np.pi * rng.integers(2) + rng.normal(0, 0.04)
    if _keeps_clear(way, place, yaw, length, width):
        site.plot.park(model, place, yaw)


def _stand(site: Site, way: Path, along: float, lateral: float) -> None:
    """Something that is not movable, a side of it towards the way."""
    rng = site.rng
    makers = [one for one in STANDING if site.furniture or one not in FURNITURE]
    size: Array = np.zeros(3)
    while max(size[:2]) < LONGER_M and size[2] < TALLER_M:
        mesh = site.some(makers[int(rng.integers(len(makers)))])(rng)
        low, high = np.asarray(mesh.bounds, dtype=np.float64)
        size, middle = high - low, -0.5 * (low + high)
    quarter = int(rng.integers(4))
    length, width = size[:2][:: 1 if quarter % 2 == 0 else -1]
    mesh = mesh.moved((middle[0], middle[1], 0.0))
    place, heading = way.at(along, lateral + np.sign(lateral) * 0.5 * width)
    yaw = float(heading)
    if _keeps_clear(way, place, yaw, float(length), float(width)):
        turned = yaw + 0.5 * np.pi * quarter
        site.plot.scatter(lambda _: mesh, place[None], np.array([turned]), ANYWHERE_M)


def _line(site: Site, way: Path, along: float, lateral: float) -> None:
    """A wall or a hedge along the way."""
    rng = site.rng
    spots = np.arange(along, along + rng.uniform(5.0, 18.0), 1.0)
    line, _ = way.at(spots, lateral + np.sign(lateral) * 0.5)
    maker = LINES[int(rng.integers(len(LINES)))]
    site.plot.run_barrier(maker, line, 0.4, ANYWHERE_M)


def _keeps_clear(way: Path, place: Array, yaw: float, length: float, width: float) -> bool:
    """Whether a rectangle leaves the ego its way, in bends too."""
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    offset = way.points - place
    along, across = offset @ ahead, offset @ np.array([-ahead[1], ahead[0]])
    gap = np.hypot(
        np.maximum(np.abs(along) - 0.5 * length, 0), np.maximum(np.abs(across) - 0.5 * width, 0)
    )
    return bool(gap.min() > EGO_HALF_M)
