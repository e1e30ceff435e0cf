"""Lines a road, block by block: houses, yards, parks, rows of parked cars and what stands about."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.barriers import BARRIERS
from lidaraccum.simulation.buildings import draw_building, draw_garage
from lidaraccum.simulation.catalogue import Catalogue
from lidaraccum.simulation.furniture import CAR_SIZED, KERB_SIDE
from lidaraccum.simulation.mesh import Mesh
from lidaraccum.simulation.models import Model
from lidaraccum.simulation.plot import Plot
from lidaraccum.simulation.roads import Road
from lidaraccum.simulation.vegetation import bush, draw_tree, tufts

Array = NDArray[np.float64]

STYLES: dict[str, dict[str, float]] = {
    "straight": {"terrace": 5, "houses": 2, "park": 1, "yard": 1, "carpark": 1},
    "curved": {"terrace": 3, "houses": 3, "park": 1, "wood": 1, "carpark": 1},
    "crossing": {"terrace": 5, "houses": 2, "park": 1, "yard": 1, "carpark": 1},
    "roundabout": {"terrace": 2, "houses": 2, "park": 2, "field": 1, "carpark": 1},
    "square": {"terrace": 5, "park": 2, "carpark": 1},
    "suburban": {"houses": 8, "park": 1, "wood": 0.5, "terrace": 0.5},
    "rural": {"field": 5, "wood": 3, "houses": 1.5, "yard": 0.5},
    "highway": {"screen": 4, "field": 3, "wood": 2, "yard": 0.5},
    "tunnel": {"screen": 3, "wood": 2, "terrace": 1},
    "bridge": {"screen": 2, "field": 2, "wood": 2, "terrace": 1, "yard": 1},
    "industrial": {"yard": 6, "carpark": 2, "terrace": 1, "field": 1},
}
"""How often a block of each style occurs in a scene of each kind."""

VARIANTS = 6
"""Different trees, bushes, bins ... of a kind in one world."""
STREET_CARS = {"car": 20.0, "van": 3.0, "truck": 0.5, "trailer": 0.4, "motorcycle": 0.6}


@dataclass(frozen=True, eq=False)
class Block:
    """A stretch of one side of a road.

    Attributes:
        road: The road.
        side: +1 left of it, -1 right.
        start: Metres along its middle line.
        end: Metres along its middle line.
    """

    road: Road
    side: int
    start: float
    end: float

    @property
    def length(self) -> float:
        """Metres."""
        return self.end - self.start

    @property
    def frontage(self) -> float:
        """From the middle line to where properties begin, metres."""
        return self.road.half_m + self.road.walk_m

    def at(self, along: Array | float, lateral: Array | float) -> tuple[Array, Array]:
        """Places and headings at metres into the block and metres from the middle line."""
        return self.road.centre.at(
            self.start + np.asarray(along), self.side * np.asarray(lateral)
        )

    def line(self, first: float, last: float, lateral: float) -> Array:
        """(K, 2) points a metre apart along the block."""
        return self.at(np.arange(first, last + 0.5, 1.0), lateral)[0]


class StreetBuilder:
    """Fills a plot with streets.

    Args:
        plot: What is built on.
        catalogue: What can be parked.
    """

    def __init__(self, plot: Plot, catalogue: Catalogue) -> None:
        self.plot = plot
        self.catalogue = catalogue
        self.rng = plot.rng
        self._pools: dict[Callable[[np.random.Generator], Mesh], list[Mesh]] = {}
        self.crowd = float(self.rng.beta(2, 2))
        self.styles: dict[str, Callable[[Block], None]] = {
            "terrace": self._terrace, "houses": self._houses, "park": self._park,
            "wood": self._wood, "field": self._field, "yard": self._yard,
            "carpark": self._carpark, "screen": self._screen,
        }  # fmt: skip

    def line_road(self, road: Road, kind: str) -> None:
        """Both sides of a road, its parking strips included."""
        chances = STYLES[kind]
        names, weights = list(chances), np.array(list(chances.values()))
        for side in (-1, 1):
            start = 0.0
            while start < road.centre.length - 8:
                end = min(start + self.rng.uniform(22, 60), road.centre.length)
                block = Block(road, side, start, end)
                style = str(self.rng.choice(names, p=weights / weights.sum()))
                start = end
                if not self._is_near(block):
                    continue
                self._park_row(block)
                self._pavement(block, style)
                self.styles[style](block)

    def _is_near(self, block: Block) -> bool:
        middle, _ = block.at(0.5 * block.length, block.frontage)
        return bool(self.plot.terrain.covers(middle[None], 12.0)[0])

    # -- the street itself ---------------------------------------------------------------------

    def _park_row(self, block: Block) -> None:
        """Parked cars in the strip beside the lanes, parallel or at an angle."""
        strip = block.road.parking_m
        if strip <= 0:
            return
        rng, share = self.rng, self.rng.beta(1.2, 1.6) * (0.35 + 0.65 * self.crowd)
        angled = strip > 4
        tilt = rng.uniform(0.9, 1.57) if angled else 0.0
        step, along = (2.7 / max(np.sin(tilt), 0.5) if angled else 5.9), 2.0
        while along < block.length - 3:
            if rng.random() < share:
                model = self.catalogue.draw_any(STREET_CARS if not angled else {"car": 9, "van": 1})
                if not angled:
                    along += max(0.5 * (model.size_lwh[0] - 4.8), 0)
                lateral = block.road.half_m - 0.5 * strip + rng.normal(0, 0.12)
                self._leave(model, block, along, lateral, block.side * tilt + rng.normal(0, 0.025))
                along += step + rng.exponential(0.3) + max(0.5 * (model.size_lwh[0] - 4.8), 0)
            else:
                along += step

    def _leave(self, model: Model, block: Block, along: float, lateral: float, turn: float) -> None:
        place, heading = block.at(along, lateral)
        others = [road for road in self.plot.network.roads if road is not block.road]
        if any(road.tree.query(place)[0] < road.half_m + 4.0 for road in others):
            return
        ahead = 0.0 if (block.side < 0) == (self.plot.network.hand > 0) else np.pi
        ahead += np.pi * (self.rng.random() < 0.1)
        self.plot.park(model, place, float(heading) + ahead + turn)

    def _pavement(self, block: Block, style: str) -> None:
        """Slim things and trees at the kerb, loose things on the pavement, people standing."""
        rng, walk = self.rng, block.road.walk_m
        at_kerb = block.road.half_m + 0.45
        if walk < 1.0:
            at_kerb = block.road.half_m + 1.2
        count = rng.poisson(block.length / rng.uniform(8, 30))
        makers = [KERB_SIDE[int(k)] for k in rng.integers(len(KERB_SIDE), size=count)]
        for maker in makers:
            self._scatter(maker, block, 1, at_kerb, at_kerb, along_street=True)
        if walk >= 2.0 and rng.random() < 0.35:
            gap = rng.uniform(7, 16)
            along = np.arange(rng.uniform(0, gap), block.length, gap)
            places, _ = block.at(along, at_kerb + 0.2)
            self.plot.scatter(self.some(draw_tree), places, rng.uniform(0, 6.28, len(along)), 0.3)
        busy = style in ("terrace", "park", "carpark") and walk > 1.5
        for _ in range(rng.poisson(block.length / 30 * (1.0 if busy else 0.3))):
            along, lateral = rng.uniform(0, block.length), block.road.half_m + 0.5 + rng.uniform(0, max(walk - 0.8, 0.2))
            self._leave_loose(block, along, lateral)

    def _leave_loose(self, block: Block, along: float, lateral: float) -> None:
        name = {"pedestrian": 5.0, "bicycle": 4.0, "motorcycle": 1.0, "pram": 0.3, "child": 0.5,
                "oddity": 0.4, "kick_scooter": 0.3, "dog": 0.2}  # fmt: skip
        place, heading = block.at(along, lateral)
        if self.plot.off_road(place[None], 0.4)[0]:
            self.plot.park(self.catalogue.draw_any(name), place, float(heading) + self.rng.normal(0, 1.5))

    def some(self, maker: Callable[[np.random.Generator], Mesh]) -> Callable[..., Mesh]:
        """A maker that takes one of this world's few things of the kind, turned and scaled."""
        pool = self._pools.setdefault(maker, [])

        def take(rng: np.random.Generator) -> Mesh:
            choice = int(rng.integers(VARIANTS))
            if choice >= len(pool):
                pool.append(maker(rng))
                choice = len(pool) - 1
            stretch = tuple(rng.uniform(0.82, 1.22) * rng.uniform(0.92, 1.08, 3))
            return pool[choice].moved((0.0, 0.0, 0.0), 0.0, stretch)

        return take

    def _scatter(
        self, maker: Callable[[np.random.Generator], Mesh], block: Block, count: int, near: float,
        far: float, *, along_street: bool = False,
    ) -> None:  # fmt: skip
        """So many things between two distances from the middle line."""
        rng = self.rng
        places, heading = block.at(rng.uniform(0, block.length, count), rng.uniform(near, far, count))
        turn = 0.5 * np.pi * rng.integers(4, size=count) if along_street else rng.uniform(0, 6.28, count)
        self.plot.scatter(self.some(maker), places, heading + turn, 0.35)

    def _car_sized(self, block: Block, count: int, near: float, far: float) -> None:
        for _ in range(count):
            maker = CAR_SIZED[int(self.rng.integers(len(CAR_SIZED)))]
            self._scatter(maker, block, 1, near, far, along_street=bool(self.rng.random() < 0.7))

    def _barrier(self, block: Block, lateral: float, chances: dict[str, float]) -> None:
        """A barrier along the block with gaps for drives, its kind drawn for each stretch."""
        rng, along = self.rng, self.rng.uniform(0, 3)
        names, weights = list(chances), np.array(list(chances.values()))
        while along < block.length - 4:
            stretch = min(rng.uniform(6, 22), block.length - along)
            name = str(rng.choice(names, p=weights / weights.sum()))
            line = block.line(along, along + stretch, lateral + rng.normal(0, 0.15))
            self.plot.run_barrier(BARRIERS[name], line, 0.35)
            along += stretch + rng.choice([0.2, 3.2, 5.0])

    # -- what lies behind the pavement -----------------------------------------------------------

    def _building(self, block: Block, along: float, width: float, setback: float, storeys: int) -> None:
        depth = float(self.rng.uniform(7, 14))
        front = block.frontage + setback
        x, y = np.meshgrid(np.linspace(along, along + width, 4), front + np.array([0, 0.5, 1]) * depth)
        spots, _ = block.at(x.ravel(), y.ravel())
        if not self.plot.off_road(spots, 1.0).all() or self.plot.network.in_square(spots).any():
            return
        radius = 0.25 * depth
        inner = spots[4:]
        if not all(self.plot.is_free(spot, radius) for spot in inner):
            return
        self.plot.take(inner, radius)
        self.plot.take(spots[:4], 1.0)
        place, heading = block.at(along + 0.5 * width, front)
        yaw = float(heading) + (0.0 if block.side > 0 else np.pi)
        self.plot.put(draw_building(width, depth, storeys, self.rng), place, yaw)

    def _terrace(self, block: Block) -> None:
        rng, along = self.rng, self.rng.uniform(0, 4)
        setback, storeys = float(rng.choice([0.1, 0.1, 0.5, 2.5])), int(rng.integers(1, 7))
        while along < block.length - 6:
            width = min(rng.uniform(7, 24), block.length - along)
            self._building(block, along, width, setback, max(storeys + int(rng.integers(-1, 2)), 1))
            along += width + (0.02 if rng.random() < 0.6 else rng.uniform(1, 6))
        if setback > 1:
            self._barrier(block, block.frontage + 0.3, {"wall": 3, "railing": 2, "hedge": 2, "pickets": 1})
        self._car_sized(block, rng.poisson(block.length / 40), block.frontage - 1.2, block.frontage + 1)

    def _houses(self, block: Block) -> None:
        rng, along, setback = self.rng, self.rng.uniform(0, 5), self.rng.uniform(3, 9)
        self._barrier(
            block, block.frontage + rng.uniform(0.2, 0.6),
            {"hedge": 5, "wall": 3, "pickets": 2.5, "boards": 1, "wire_mesh": 1.5, "railing": 1,
             "blocks": 0.3, "bank": 0.5},
        )  # fmt: skip
        while along < block.length - 7:
            width = min(rng.uniform(7, 14), block.length - along)
            self._building(block, along, width, setback + rng.uniform(-1, 1), int(rng.integers(1, 4)))
            drive = along + width + 1.8
            if rng.random() < 0.6:
                garage_front = setback + rng.uniform(0, 3)
                place, heading = block.at(drive, block.frontage + garage_front)
                if self.plot.off_road(place[None], 3)[0] and self.plot.is_free(place, 1.5):
                    self.plot.take(place, 2.5)
                    yaw = float(heading) + (0.0 if block.side > 0 else np.pi)
                    self.plot.put(draw_garage(rng), place, yaw)
            if rng.random() < 0.45:
                car = self.catalogue.draw_any({"car": 8, "van": 1, "trailer": 1})
                place, heading = block.at(drive, block.frontage + 2.8)
                if self.plot.off_road(place[None], 2.3)[0]:
                    self.plot.park(car, place, float(heading) + rng.choice([-1, 1]) * np.pi / 2)
            along += width + rng.uniform(3.5, 9)
        self._garden(block, setback)

    def _garden(self, block: Block, setback: float) -> None:
        rng, front = self.rng, block.frontage
        self._scatter(bush, block, rng.poisson(block.length / 9), front + 0.8, front + setback)
        self._scatter(draw_tree, block, rng.poisson(block.length / 16), front + 1.5, front + setback + 14)
        self._car_sized(block, rng.poisson(block.length / 25), front + 1, front + setback + 3)
        back = front + setback + rng.uniform(14, 20)
        self._barrier(block, back, {"hedge": 3, "boards": 1, "wire_mesh": 1, "wall": 1})

    def _park(self, block: Block) -> None:
        rng, front = self.rng, block.frontage
        if rng.random() < 0.6:
            self._barrier(block, front + 0.4, {"hedge": 3, "wall": 2, "railing": 2, "wire_mesh": 1, "bank": 1})
        self._scatter(draw_tree, block, rng.poisson(block.length / 7), front + 1, front + 30)
        self._scatter(bush, block, rng.poisson(block.length / 5), front + 0.8, front + 20)
        self._scatter(tufts, block, rng.poisson(block.length / 6), front + 0.5, front + 15)
        self._car_sized(block, rng.poisson(block.length / 9), front + 0.8, front + 18)

    def _wood(self, block: Block) -> None:
        rng, front = self.rng, block.frontage
        self._scatter(draw_tree, block, rng.poisson(block.length / 3.5), front + 1.5, front + 25)
        self._scatter(bush, block, rng.poisson(block.length / 4), front + 1.2, front + 14)
        self._scatter(tufts, block, rng.poisson(block.length / 2.5), front + 0.6, front + 10)

    def _field(self, block: Block) -> None:
        rng, front = self.rng, block.frontage
        if rng.random() < 0.55:
            kinds = {"hedge": 3, "wire_mesh": 1, "guard_rail": 2, "railing": 1, "wall": 1, "bank": 1}
            self._barrier(block, front + rng.uniform(0.8, 3), kinds)
        self._scatter(draw_tree, block, rng.poisson(block.length / 25), front + 2, front + 40)
        self._scatter(bush, block, rng.poisson(block.length / 14), front + 1.5, front + 25)
        self._scatter(tufts, block, rng.poisson(block.length / 3), front + 0.6, front + 12)
        self._car_sized(block, rng.poisson(block.length / 45), front + 2, front + 25)

    def _yard(self, block: Block) -> None:
        rng, front = self.rng, block.frontage
        kinds = {"wire_mesh": 4, "wall": 1, "blocks": 1.5, "boards": 0.7, "railing": 0.7, "bank": 0.7}
        self._barrier(block, front + 0.5, kinds)
        if rng.random() < 0.7:
            setback = rng.uniform(10, 25)
            self._building(block, 2, min(block.length - 4, rng.uniform(15, 45)), setback, int(rng.integers(1, 4)))
        self._car_sized(block, rng.poisson(block.length / 4), front + 1.5, front + 22)
        chances = {"car": 5, "van": 2, "truck": 2, "trailer": 2, "oddity": 1.0}
        for _ in range(rng.poisson(block.length / 14 * (0.3 + self.crowd))):
            self._leave_off(block, chances, front + 3, front + 18)

    def _leave_off(self, block: Block, chances: dict[str, float], near: float, far: float) -> None:
        rng = self.rng
        place, heading = block.at(rng.uniform(0, block.length), rng.uniform(near, far))
        if self.plot.off_road(place[None], 2.5)[0]:
            turn = rng.choice([0, np.pi / 2, np.pi, -np.pi / 2]) + rng.normal(0, 0.2)
            self.plot.park(self.catalogue.draw_any(chances), place, float(heading) + turn)

    def _carpark(self, block: Block) -> None:
        """Rows of bays across the street, some taken, some with bushes between."""
        rng, front = self.rng, block.frontage
        self._barrier(block, front + 0.5, {"hedge": 2, "railing": 1, "blocks": 1, "wall": 1})
        share, tilt = rng.uniform(0.1, 0.75) * (0.4 + 0.6 * self.crowd), rng.uniform(1.2, 1.57)
        for row in range(int(rng.integers(1, 4))):
            lateral = front + 4 + row * (8.5 if row % 2 else 9.5)
            for along in np.arange(2, block.length - 2, 2.75):
                if rng.random() > share:
                    continue
                place, heading = block.at(along, lateral)
                if self.plot.off_road(place[None], 3)[0]:
                    car = self.catalogue.draw_any({"car": 12, "van": 1})
                    turn = tilt * rng.choice([-1, 1]) + rng.normal(0, 0.04)
                    self.plot.park(car, place, float(heading) + turn)
        self._car_sized(block, rng.poisson(block.length / 15), front + 1, front + 30)
        self._scatter(draw_tree, block, rng.poisson(block.length / 15), front + 1, front + 30)

    def _screen(self, block: Block) -> None:
        """Beside a fast road: rails, noise walls, banks; trees beyond."""
        rng, front = self.rng, block.frontage
        if rng.random() < 0.7:
            self.plot.run_barrier(BARRIERS["guard_rail"], block.line(0, block.length, front + 0.8), 0.3)
        name = str(rng.choice(["noise_wall", "bank", "hedge", "wire_mesh", "wall"]))
        line = block.line(0, block.length, front + rng.uniform(2.5, 7))
        self.plot.run_barrier(BARRIERS[name], line, 0.5)
        self._scatter(draw_tree, block, rng.poisson(block.length / 6), front + 6, front + 30)
        self._scatter(bush, block, rng.poisson(block.length / 6), front + 2, front + 12)
        self._scatter(tufts, block, rng.poisson(block.length / 4), front + 1.2, front + 8)
