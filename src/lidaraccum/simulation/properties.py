"""What lies behind the pavement: terraces, houses with gardens, parks, fields, yards, car parks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lidaraccum.simulation.barriers import BARRIERS
from lidaraccum.simulation.buildings import draw_garage
from lidaraccum.simulation.site import Block, Site
from lidaraccum.simulation.vegetation import bush, draw_tree, tufts


def _terrace(site: Site, block: Block) -> None:
    rng, along = site.rng, site.rng.uniform(0, 4)
    setback, storeys = float(rng.choice([0.1, 0.1, 0.5, 2.5])), int(rng.integers(1, 8))
    while along < block.length - 6:
        width = min(rng.uniform(7, 24), block.length - along)
        site.building(block, along, width, setback, max(storeys + int(rng.integers(-1, 2)), 1))
        along += width + (0.02 if rng.random() < 0.6 else rng.uniform(1, 6))
    if setback > 1:
        site.barrier(
            block, block.frontage + 0.3, {"wall": 3, "railing": 2, "hedge": 2, "pickets": 1}
        )
    site.car_sized(block, rng.poisson(block.length / 22), block.frontage - 1.2, block.frontage + 1)


def _houses(site: Site, block: Block) -> None:
    rng, along, setback = site.rng, site.rng.uniform(0, 5), site.rng.uniform(3, 9)
    site.barrier(
        block, block.frontage + rng.uniform(0.2, 0.6),
        {"hedge": 5, "wall": 3, "pickets": 2.5, "boards": 1, "wire_mesh": 1.5, "railing": 1,
         "blocks": 0.3, "bank": 0.5},
    )  # fmt: skip
    while along < block.length - 7:
        width = min(rng.uniform(7, 14), block.length - along)
        site.building(block, along, width, setback + rng.uniform(-1, 1), int(rng.integers(1, 4)))
        drive = along + width + 1.8
        if rng.random() < 0.6:
            garage_front = setback + rng.uniform(0, 3)
            place, heading = block.at(drive, block.frontage + garage_front)
            if site.plot.off_road(place[None], 3)[0] and site.plot.is_free(place, 1.5):
                site.plot.take(place, 2.5)
                yaw = float(heading) + (0.0 if block.side > 0 else np.pi)
                site.plot.put(draw_garage(rng), place, yaw)
        if rng.random() < 0.45:
            car = site.catalogue.draw_any({"car": 8, "van": 1, "trailer": 1})
            place, heading = block.at(drive, block.frontage + 2.8)
            if site.plot.off_road(place[None], 2.3)[0]:
                site.plot.park(car, place, float(heading) + rng.choice([-1, 1]) * np.pi / 2)
        along += width + rng.uniform(3.5, 9)
    _garden(site, block, setback)


def _garden(site: Site, block: Block, setback: float) -> None:
    rng, front = site.rng, block.frontage
    site.scatter(bush, block, rng.poisson(block.length / 4.5), front + 0.8, front + setback)
    site.scatter(draw_tree, block, rng.poisson(block.length / 6), front + 1.5, front + setback + 14)
    site.car_sized(block, rng.poisson(block.length / 15), front + 1, front + setback + 3)
    back = front + setback + rng.uniform(14, 20)
    site.barrier(block, back, {"hedge": 3, "boards": 1, "wire_mesh": 1, "wall": 1})


def _park(site: Site, block: Block) -> None:
    rng, front = site.rng, block.frontage
    if rng.random() < 0.6:
        site.barrier(
            block, front + 0.4, {"hedge": 3, "wall": 2, "railing": 2, "wire_mesh": 1, "bank": 1}
        )
    site.scatter(draw_tree, block, rng.poisson(block.length / 4), front + 1, front + 30)
    site.scatter(bush, block, rng.poisson(block.length / 2.5), front + 0.8, front + 20)
    site.scatter(tufts, block, rng.poisson(block.length / 6), front + 0.5, front + 15)
    site.car_sized(block, rng.poisson(block.length / 9), front + 0.8, front + 18)


def _wood(site: Site, block: Block) -> None:
    rng, front = site.rng, block.frontage
    site.scatter(draw_tree, block, rng.poisson(block.length / 3.5), front + 1.5, front + 25)
    site.scatter(bush, block, rng.poisson(block.length / 2.2), front + 1.2, front + 14)
    site.scatter(tufts, block, rng.poisson(block.length / 2.5), front + 0.6, front + 10)
    site.car_sized(block, rng.poisson(block.length / 30), front + 1, front + 12)


def _field(site: Site, block: Block) -> None:
    rng, front = site.rng, block.frontage
    if rng.random() < 0.55:
        kinds = {
            "hedge": 3,
            "wire_mesh": 1,
            "guard_rail": 2,
            "railing": 1,
            "wall": 1,
            "bank": 1,
        }
        site.barrier(block, front + rng.uniform(0.8, 3), kinds)
    site.scatter(draw_tree, block, rng.poisson(block.length / 12), front + 2, front + 40)
    site.scatter(bush, block, rng.poisson(block.length / 8), front + 1.5, front + 25)
    site.scatter(tufts, block, rng.poisson(block.length / 3), front + 0.6, front + 12)
    site.car_sized(block, rng.poisson(block.length / 28), front + 1.5, front + 20)


def _yard(site: Site, block: Block) -> None:
    rng, front = site.rng, block.frontage
    kinds = {
        "wire_mesh": 4,
        "wall": 1,
        "blocks": 1.5,
        "boards": 0.7,
        "railing": 0.7,
        "bank": 0.7,
    }
    site.barrier(block, front + 0.5, kinds)
    if rng.random() < 0.7:
        setback = rng.uniform(10, 25)
        site.building(
            block,
            2,
            min(block.length - 4, rng.uniform(15, 45)),
            setback,
            int(rng.integers(1, 4)),
        )
    site.car_sized(block, rng.poisson(block.length / 4), front + 1.5, front + 22)
    chances = {"car": 5, "van": 2, "truck": 2, "trailer": 2, "oddity": 1.0}
    for _ in range(rng.poisson(block.length / 14 * (0.3 + site.crowd))):
        site.leave_off(block, chances, front + 3, front + 18)


def _carpark(site: Site, block: Block) -> None:
    """Rows of bays across the street, some taken, some with bushes between."""
    rng, front = site.rng, block.frontage
    site.barrier(block, front + 0.5, {"hedge": 2, "railing": 1, "blocks": 1, "wall": 1})
    share, tilt = rng.uniform(0.1, 0.75) * (0.4 + 0.6 * site.crowd), rng.uniform(1.2, 1.57)
    for row in range(int(rng.integers(1, 4))):
        lateral = front + 4 + row * (8.5 if row % 2 else 9.5)
        for along in np.arange(2, block.length - 2, 2.75):
            if rng.random() > share:
                continue
            place, heading = block.at(along, lateral)
            if site.plot.off_road(place[None], 3)[0]:
                car = site.catalogue.draw_any({"car": 12, "van": 1})
                turn = tilt * rng.choice([-1, 1]) + rng.normal(0, 0.04)
                site.plot.park(car, place, float(heading) + turn)
    site.car_sized(block, rng.poisson(block.length / 15), front + 1, front + 30)
    site.scatter(draw_tree, block, rng.poisson(block.length / 15), front + 1, front + 30)


def _screen(site: Site, block: Block) -> None:
    """Beside a fast road: rails, noise walls, banks; trees beyond."""
    rng, front = site.rng, block.frontage
    if rng.random() < 0.7:
        site.plot.run_barrier(BARRIERS["guard_rail"], block.line(0, block.length, front + 0.8), 0.3)
    name = str(rng.choice(["noise_wall", "bank", "hedge", "wire_mesh", "wall"]))
    line = block.line(0, block.length, front + rng.uniform(2.5, 7))
    site.plot.run_barrier(BARRIERS[name], line, 0.5)
    site.scatter(draw_tree, block, rng.poisson(block.length / 6), front + 6, front + 30)
    site.scatter(bush, block, rng.poisson(block.length / 6), front + 2, front + 12)
    site.scatter(tufts, block, rng.poisson(block.length / 4), front + 1.2, front + 8)
    site.car_sized(block, rng.poisson(block.length / 35), front + 1.5, front + 10)


PROPERTIES: dict[str, Callable[[Site, Block], None]] = {
    "terrace": _terrace, "houses": _houses, "park": _park, "wood": _wood, "field": _field,
    "yard": _yard, "carpark": _carpark, "screen": _screen,
}  # fmt: skip
"""What can lie behind a pavement, by name."""
