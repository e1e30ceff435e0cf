"""What a built-up block has beside its properties: growth from the ground, lines across, cars near.

Set last, and drawn from a generator of its own, so that nothing else in a world moves by it. Seen
in recordings and missing before: hedges that run across (between bays, between gardens) and round
corners, and end after a car's length; leaves from the ground on; cars half on pavements, in drives
between hedges, at odd angles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.barriers import BARRIERS
from lidaraccum.simulation.furniture import bins, kiosk, planter
from lidaraccum.simulation.growth import (
    carport,
    clipped,
    gate,
    grown_over,
    low_tree,
    shrub,
    wild_hedge,
)
from lidaraccum.simulation.mesh import Mesh
from lidaraccum.simulation.site import Block, Site
from lidaraccum.simulation.vegetation import hedge

Array = NDArray[np.float64]

GREEN = {"houses": 1.0, "park": 0.8, "carpark": 0.7, "terrace": 0.5, "wood": 0.6, "field": 0.4,
         "yard": 0.3, "screen": 0.4}  # fmt: skip
"""How much of it a block of each style has."""

LINES: tuple[tuple[Callable[[Array, np.random.Generator], Mesh], float], ...] = (
    (hedge, 5.0), (wild_hedge, 3.0), (grown_over, 2.0), (BARRIERS["wall"], 1.5),
    (BARRIERS["pickets"], 0.7), (BARRIERS["boards"], 0.7), (BARRIERS["wire_mesh"], 0.6),
)  # fmt: skip
"""What runs between gardens and round their corners, and how often."""

SEEN_M = 35.0
"""Blocks further from the ego's way than this are left as they are."""

LEAST_ROOM_M = 0.4
"""What is scattered needs this much about it."""

FREE_M = 0.45
"""Half of what a line of growth takes up."""


def overgrow(site: Site, blocks: Sequence[tuple[Block, str]], way: Array, green: float) -> None:
    """Fill what is left of the blocks near the ego; how much differs from world to world.

    Args:
        site: What is built on; all draws come from its generator.
        blocks: Blocks that were lined, with their styles.
        way: (K, 2) where the ego drives, metres.
        green: So many times as much as drawn, up to all there may be.
    """
    much = min(1.0, green * float(site.rng.beta(1.3, 1.0)))
    for block, style in blocks:
        share = much * GREEN[style]
        if share < 0.05 or not _is_seen(block, way):
            continue
        _islands(site, block, share)
        _cars(site, block, share, style)
        _lines(site, block, share)
        _growth(site, block, share)
        _things(site, block, share)


def _is_seen(block: Block, way: Array) -> bool:
    """Whether any of the block is near the way; far ones are mostly hidden, and cost as much."""
    spots, _ = block.at(np.linspace(0, block.length, 8), block.frontage)
    gap = np.linalg.norm(spots[:, None] - way, axis=2)
    return bool(gap.min() < SEEN_M)


def _draw_line(rng: np.random.Generator) -> Callable[[Array, np.random.Generator], Mesh]:
    weights = np.array([weight for _, weight in LINES])
    return LINES[int(rng.choice(len(LINES), p=weights / weights.sum()))][0]


def _across(block: Block, along: float, first: float, last: float) -> Array:
    """(K, 2) points away from the street, about 0.6 m apart."""
    lateral = np.linspace(first, last, max(int((last - first) / 0.6) + 1, 5))
    return block.at(np.full(len(lateral), along), lateral)[0]


def _clear_of_others(site: Site, block: Block, along: float) -> bool:
    """Whether no other road meets this one here."""
    place, _ = block.at(along, block.road.half_m)
    others = (road for road in site.plot.network.roads if road is not block.road)
    return all(road.tree.query(place)[0] > road.half_m + 5.0 for road in others)


def _islands(site: Site, block: Block, share: float) -> None:
    """Hedges and shrubs across the parking strip, between the bays."""
    rng, road = site.rng, block.road
    if road.parking_m <= 0 or rng.random() > 0.3 + 0.6 * share:
        return
    gap, along = rng.uniform(5.5, 16), rng.uniform(1, 8)
    while along < block.length - 1:
        if _clear_of_others(site, block, along):
            line = _across(block, along, road.half_m - road.parking_m + 0.5, road.half_m + 0.2)
            maker = hedge if rng.random() < 0.6 else wild_hedge
            site.plot.run_barrier(maker, line, FREE_M, 0.3 - road.parking_m)
        along += gap * rng.uniform(0.8, 1.2)


def _cars(site: Site, block: Block, share: float, style: str) -> None:
    """Parked half on the pavement, in drives between hedges, at odd angles."""
    rng, road = site.rng, block.road
    if road.walk_m >= 1.2 and road.parking_m <= 0 and road.speed_mps < 16:
        for _ in range(rng.poisson(block.length / 22 * (0.2 + site.crowd))):
            lateral = road.half_m + rng.uniform(0.55, 1.2)
            car = site.catalogue.draw_any({"car": 12, "van": 1.5, "trailer": 0.3})
            site.leave(car, block, rng.uniform(2, block.length), lateral, rng.normal(0, 0.05))
    if style not in ("houses", "park", "carpark", "terrace"):
        return
    for _ in range(rng.poisson(block.length / 24 * (0.4 + share))):
        _drive(site, block, rng.uniform(2.5, block.length - 2.5))
    for _ in range(rng.poisson(block.length / 60)):
        site.leave_off(block, {"car": 8, "van": 1, "trailer": 1}, block.frontage + 2,
                       block.frontage + 12)  # fmt: skip


def _drive(site: Site, block: Block, along: float) -> None:
    """A car across the street behind the pavement; hedges or walls close beside it, or a roof."""
    rng = site.rng
    depth = block.frontage + rng.uniform(2.4, 5.5)
    place, heading = block.at(along, depth)
    if not site.plot.off_road(place[None], 2.3)[0]:
        return
    yaw = float(heading) + float(rng.choice([-0.5, 0.5])) * np.pi + rng.normal(0, 0.1)
    if not site.plot.park(site.catalogue.draw_any({"car": 10, "van": 1}), place, yaw):
        return
    if rng.random() < 0.2:
        site.plot.put(carport(rng), place, yaw)
    for side in (-1, 1):
        if rng.random() < 0.6:
            line = _across(block, along + side * rng.uniform(1.5, 2.6), block.frontage + 0.4,
                           block.frontage + rng.uniform(3.5, 8))  # fmt: skip
            site.plot.run_barrier(_draw_line(rng), line, 0.35)


def _lines(site: Site, block: Block, share: float) -> None:
    """Across, between gardens; short ones along; and some that turn a corner."""
    rng, front = site.rng, block.frontage
    along = rng.uniform(0, 8)
    while along < block.length:
        if rng.random() < 0.25 + 0.6 * share:
            first = front + rng.uniform(0.3, 1.5)
            line = _across(block, along, first, first + rng.uniform(2.5, 10))
            site.plot.run_barrier(_draw_line(rng), line, FREE_M)
        along += rng.uniform(5, 15)
    for _ in range(rng.poisson(share * block.length / 9)):
        start, long = rng.uniform(0, block.length), rng.uniform(3.0, 6.5)
        line = block.line(start, start + long, front + rng.uniform(0.3, 7))
        site.plot.run_barrier(_draw_line(rng), line, FREE_M)
    for _ in range(rng.poisson(share * block.length / 30)):
        line = _corner(block, rng.uniform(4, max(block.length - 4, 5)), front + 0.5, rng)
        site.plot.run_barrier(_draw_line(rng), line, FREE_M)


def _corner(block: Block, along: float, lateral: float, rng: np.random.Generator) -> Array:
    """(K, 2) points along the street, round a quarter of a circle, and away from it."""
    radius, hand = rng.uniform(0.8, 5.0), float(rng.choice([-1, 1]))
    before, after = rng.uniform(0, 6), rng.uniform(0, 6)
    angle = np.linspace(0, 0.5 * np.pi, max(int(1.6 * radius), 3))
    x = np.concatenate([np.arange(-before, 0, 0.8), radius * np.sin(angle),
                        np.full(int(after / 0.8), radius)])  # fmt: skip
    bend = radius * (1 - np.cos(angle))
    y = np.concatenate(
        [
            np.zeros(len(np.arange(-before, 0, 0.8))),
            bend,
            radius + 0.8 * (1 + np.arange(int(after / 0.8))),
        ]
    )
    return block.at(along + hand * x, lateral + y)[0]


def _growth(site: Site, block: Block, share: float) -> None:
    """Shrubs, clipped blocks and low crowns, near the pavement and further in."""
    rng, front, length = site.rng, block.frontage, block.length
    near, far = front + 0.4, front + rng.uniform(4, 12)
    _scatter(site, shrub, block, rng.poisson(share * length / 2.0), near, far)
    _scatter(site, clipped, block, rng.poisson(share * length / 8), near, far, along_street=True)
    _scatter(site, low_tree, block, rng.poisson(share * length / 4.0), near + 0.3, far + 8)
    if block.road.walk_m >= 2 and rng.random() < 0.3 * share:
        lateral = block.road.half_m + 0.6
        _scatter(site, low_tree, block, rng.poisson(length / 14), lateral, lateral + 0.3)


def _things(site: Site, block: Block, share: float) -> None:
    """Gate posts, rows of bins, sheds, tubs."""
    rng, front, length = site.rng, block.frontage, block.length
    _scatter(site, gate, block, rng.poisson(share * length / 18), front + 0.3, front + 0.6,
                 along_street=True)  # fmt: skip
    _scatter(site, bins, block, rng.poisson(share * length / 25), front - 0.3, front + 2,
                 along_street=True)  # fmt: skip
    _scatter(site, kiosk, block, rng.poisson(share * length / 45), front + 3, front + 14,
                 along_street=True)  # fmt: skip
    _scatter(site, planter, block, rng.poisson(share * length / 40), front + 0.4, front + 4)


def _scatter(
    site: Site, maker: Callable[[np.random.Generator], Mesh], block: Block, count: int,
    near: float, far: float, *, along_street: bool = False,
) -> None:  # fmt: skip
    """As ``site.scatter``, but what would stand in something's place is not made at all."""
    rng = site.rng
    places, heading = block.at(rng.uniform(0, block.length, count), rng.uniform(near, far, count))
    quarter = 0.5 * np.pi * rng.integers(4, size=count)
    turn = quarter if along_street else rng.uniform(0, 2 * np.pi, count)
    room = site.plot.are_free(places, LEAST_ROOM_M)
    site.stand(maker, places[room], (heading + turn)[room], 0.35)
