"""Lines a road on both sides: parked rows, what stands at the kerb, and the properties behind."""

from __future__ import annotations

import numpy as np

from lidaraccum.simulation.furniture import KERB_SIDE
from lidaraccum.simulation.properties import PROPERTIES
from lidaraccum.simulation.roads import Road
from lidaraccum.simulation.site import Block, Site
from lidaraccum.simulation.vegetation import draw_tree

EDGE_M = 28.0
"""Blocks nearer to the edge of the ground than this stay empty."""

STYLES: dict[str, dict[str, float]] = {
    "straight": {"terrace": 7, "houses": 2, "park": 1, "yard": 1, "carpark": 1},
    "curved": {"terrace": 3, "houses": 3, "park": 1, "wood": 1, "carpark": 1},
    "crossing": {"terrace": 7, "houses": 2, "park": 1, "yard": 1, "carpark": 1},
    "roundabout": {"terrace": 2, "houses": 2, "park": 2, "field": 1, "carpark": 1},
    "square": {"terrace": 6, "park": 2, "carpark": 1},
    "suburban": {"houses": 8, "park": 1, "wood": 0.5, "terrace": 0.5},
    "rural": {"field": 5, "wood": 3, "houses": 1.5, "yard": 0.5},
    "highway": {"screen": 4, "field": 3, "wood": 2, "yard": 0.5},
    "tunnel": {"screen": 3, "wood": 2, "terrace": 1},
    "bridge": {"screen": 2, "field": 2, "wood": 2, "terrace": 1, "yard": 1},
    "industrial": {"yard": 6, "carpark": 2, "terrace": 1, "field": 1},
}
"""How often a block of each style occurs in a scene of each kind."""

STREET_CARS = {"car": 20.0, "van": 3.0, "truck": 0.5, "trailer": 0.4, "motorcycle": 0.6}


def line_road(site: Site, road: Road, kind: str) -> list[tuple[Block, str]]:
    """Both sides of a road, its parking strips included, block by block.

    Returns:
        The blocks that were lined and their styles.
    """
    rng, chances = site.rng, STYLES[kind]
    lined: list[tuple[Block, str]] = []
    names, weights = list(chances), np.array(list(chances.values()))
    for side in (-1, 1):
        start = 0.0
        while start < road.centre.length - 8:
            end = min(start + rng.uniform(22, 60), road.centre.length)
            block = Block(road, side, start, end)
            style = str(rng.choice(names, p=weights / weights.sum()))
            start = end
            if _is_near(site, block):
                _park_row(site, block)
                _pavement(site, block, style)
                PROPERTIES[style](site, block)
                lined.append((block, style))
    return lined


def _is_near(site: Site, block: Block) -> bool:
    middle, _ = block.at(0.5 * block.length, block.frontage)
    return bool(site.plot.terrain.covers(middle[None], EDGE_M)[0])


def _park_row(site: Site, block: Block) -> None:
    """Parked cars in the strip beside the lanes, parallel or at an angle."""
    strip = block.road.parking_m
    if strip <= 0:
        return
    rng, share = site.rng, site.rng.beta(1.5, 1.4) * (0.45 + 0.55 * site.crowd)
    angled = strip > 4
    tilt = rng.uniform(0.9, 1.57) if angled else 0.0
    step, along = (2.7 / max(np.sin(tilt), 0.5) if angled else 5.9), 2.0
    while along < block.length - 3:
        if rng.random() < share:
            model = site.catalogue.draw_any(STREET_CARS if not angled else {"car": 9, "van": 1})
            if not angled:
                along += max(0.5 * (model.size_lwh[0] - 4.8), 0)
            lateral = block.road.half_m - 0.5 * strip + rng.normal(0, 0.12)
            site.leave(model, block, along, lateral, block.side * tilt + rng.normal(0, 0.025))
            along += step + rng.exponential(0.3) + max(0.5 * (model.size_lwh[0] - 4.8), 0)
        else:
            along += step


def _pavement(site: Site, block: Block, style: str) -> None:
    """Slim things and trees at the kerb, loose things on the pavement, people standing."""
    rng, walk = site.rng, block.road.walk_m
    at_kerb = block.road.half_m + 0.45
    if walk < 1.0:
        at_kerb = block.road.half_m + 1.2
    count = rng.poisson(block.length / rng.uniform(8, 30))
    makers = [KERB_SIDE[int(k)] for k in rng.integers(len(KERB_SIDE), size=count)]
    for maker in makers:
        site.scatter(maker, block, 1, at_kerb, at_kerb, along_street=True)
    if walk >= 1.5 and rng.random() < 0.5:
        gap = rng.uniform(5, 14)
        along = np.arange(rng.uniform(0, gap), block.length, gap)
        places, _ = block.at(along, at_kerb + 0.2)
        site.stand(draw_tree, places, rng.uniform(0, 6.28, len(along)), 0.3)
    if block.road.speed_mps > 18:
        return
    busy = style in ("terrace", "park", "carpark") and walk > 1.5
    for _ in range(rng.poisson(block.length / 30 * (1.0 if busy else 0.3))):
        lateral = block.road.half_m + 0.5 + rng.uniform(0, max(walk - 0.8, 0.2))
        site.leave_loose(block, rng.uniform(0, block.length), float(lateral))
