"""One side of a road, block by block, and the hands that set things there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.barriers import BARRIERS
from lidaraccum.simulation.buildings import draw_building
from lidaraccum.simulation.catalogue import Catalogue
from lidaraccum.simulation.furniture import CAR_SIZED, FURNITURE
from lidaraccum.simulation.mesh import Mesh
from lidaraccum.simulation.models import Model
from lidaraccum.simulation.plot import Plot
from lidaraccum.simulation.roads import Road

Array = NDArray[np.float64]
Maker = Callable[[np.random.Generator], Mesh]
VARIANTS = 6
"""Different trees, bushes, bins ... of a kind in one world."""
LOOSE = {"pedestrian": 5.0, "bicycle": 4.0, "motorcycle": 1.0, "pram": 0.3, "child": 0.5,
         "oddity": 0.4, "kick_scooter": 0.3, "dog": 0.2}  # fmt: skip
"""What stands about on pavements."""


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
        return self.road.centre.at(self.start + np.asarray(along), self.side * np.asarray(lateral))

    def line(self, first: float, last: float, lateral: float) -> Array:
        """(K, 2) points a metre apart along the block."""
        return self.at(np.arange(first, last + 0.5, 1.0), lateral)[0]


class Site:
    """A plot with what can be set on it.

    Args:
        plot: What is built on.
        catalogue: What can be parked.
        furniture: Whether `FURNITURE` is put anywhere.
    """

    def __init__(self, plot: Plot, catalogue: Catalogue, *, furniture: bool = True) -> None:
        self.plot = plot
        self.catalogue = catalogue
        self.furniture = furniture
        self.rng = plot.rng
        self.crowd = float(self.rng.beta(2, 2))
        self._pools: dict[Maker, list[Mesh]] = {}

    def some(self, maker: Callable[[np.random.Generator], Mesh]) -> Callable[..., Mesh]:
        """A maker that takes one of this world's few things of the kind, turned and scaled."""
        pool = self._pools.setdefault(maker, [])

        def take(rng: np.random.Generator) -> Mesh:
            choice = int(rng.integers(VARIANTS))
            if choice >= len(pool):
                pool.append(self.plot.thickets.body(maker, maker(rng)))
                choice = len(pool) - 1
            stretch = tuple(rng.uniform(0.82, 1.22) * rng.uniform(0.92, 1.08, 3))
            return pool[choice].moved((0.0, 0.0, 0.0), 0.0, stretch)

        return take

    def stand(self, maker: Maker, places: Array, yaws: Array, margin: float) -> None:
        """One of a kind at each place (N, 2) that is free, ``margin`` from the carriageway."""
        if self.furniture or maker not in FURNITURE:
            self.plot.scatter(self.some(maker), places, yaws, margin)

    def scatter(
        self, maker: Callable[[np.random.Generator], Mesh], block: Block, count: int, near: float,
        far: float, *, along_street: bool = False,
    ) -> None:  # fmt: skip
        """So many things between two distances from the middle line."""
        if count == 0:
            return
        rng = self.rng
        places, heading = block.at(
            rng.uniform(0, block.length, count), rng.uniform(near, far, count)
        )
        turn = (
            0.5 * np.pi * rng.integers(4, size=count)
            if along_street
            else rng.uniform(0, 6.28, count)
        )
        self.stand(maker, places, heading + turn, 0.35)

    def car_sized(self, block: Block, count: int, near: float, far: float) -> None:
        """So many of the things that are as large as cars and are none."""
        for _ in range(count):
            maker = CAR_SIZED[int(self.rng.integers(len(CAR_SIZED)))]
            self.scatter(maker, block, 1, near, far, along_street=bool(self.rng.random() < 0.7))

    def barrier(self, block: Block, lateral: float, chances: Mapping[str, float]) -> None:
        """A barrier along the block with gaps for drives, its kind drawn for each stretch."""
        rng, along = self.rng, self.rng.uniform(0, 3)
        names, weights = list(chances), np.array(list(chances.values()))
        while along < block.length - 4:
            stretch = min(rng.uniform(3.5, 20), block.length - along)
            name = str(rng.choice(names, p=weights / weights.sum()))
            line = block.line(along, along + stretch, lateral + rng.normal(0, 0.15))
            self.plot.run_barrier(BARRIERS[name], line, 0.35)
            along += stretch + rng.choice([0.2, 3.2, 5.0])

    def building(
        self, block: Block, along: float, width: float, setback: float, storeys: int
    ) -> None:
        """A building with its front ``setback`` metres behind the pavement, if there is room."""
        depth = float(self.rng.uniform(7, 14))
        front = block.frontage + setback
        x, y = np.meshgrid(
            np.linspace(along, along + width, 4), front + np.array([0, 0.5, 1]) * depth
        )
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

    def leave(self, model: Model, block: Block, along: float, lateral: float, turn: float) -> None:
        """Park a model beside the lanes, in driving direction turned by ``turn`` radians."""
        place, heading = block.at(along, lateral)
        others = [road for road in self.plot.network.roads if road is not block.road]
        if any(road.tree.query(place)[0] < road.half_m + 4.0 for road in others):
            return
        ahead = 0.0 if (block.side < 0) == (self.plot.network.hand > 0) else np.pi
        ahead += np.pi * (self.rng.random() < 0.1)
        self.plot.park(model, place, float(heading) + ahead + turn)

    def leave_loose(self, block: Block, along: float, lateral: float) -> None:
        """Leave someone or something standing on the pavement."""
        name = {"pedestrian": 5.0, "bicycle": 4.0, "motorcycle": 1.0, "pram": 0.3, "child": 0.5,
                "oddity": 0.4, "kick_scooter": 0.3, "dog": 0.2}  # fmt: skip
        place, heading = block.at(along, lateral)
        if self.plot.off_road(place[None], 0.4)[0]:
            self.plot.park(
                self.catalogue.draw_any(name), place, float(heading) + self.rng.normal(0, 1.5)
            )

    def leave_off(
        self, block: Block, chances: Mapping[str, float], near: float, far: float
    ) -> None:
        """Park something off the road, between two distances from its middle line."""
        rng = self.rng
        place, heading = block.at(rng.uniform(0, block.length), rng.uniform(near, far))
        if self.plot.off_road(place[None], 2.5)[0]:
            turn = rng.choice([0, np.pi / 2, np.pi, -np.pi / 2]) + rng.normal(0, 0.2)
            self.plot.park(self.catalogue.draw_any(chances), place, float(heading) + turn)
