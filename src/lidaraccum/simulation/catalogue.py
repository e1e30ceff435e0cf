"""The movable shapes of one world: a few of each kind, drawn once, repainted each time."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from lidaraccum.simulation.cars import draw_car, draw_paint, draw_van
from lidaraccum.simulation.heavies import draw_bus, draw_trailer, draw_truck
from lidaraccum.simulation.models import Model
from lidaraccum.simulation.oddities import draw_oddity
from lidaraccum.simulation.people import draw_child, draw_dog, draw_pedestrian, draw_pram
from lidaraccum.simulation.riders import (
    draw_bicycle,
    draw_cyclist,
    draw_kick_scooter,
    draw_motorcycle,
    draw_motorcyclist,
)

Maker = Callable[[np.random.Generator], Model]

MAKERS: dict[str, Maker] = {
    "car": draw_car, "van": draw_van, "truck": draw_truck, "bus": draw_bus,
    "tram": lambda rng: draw_bus(rng, "Tram"), "trailer": draw_trailer,
    "motorcyclist": draw_motorcyclist, "motorcycle": draw_motorcycle, "cyclist": draw_cyclist,
    "bicycle": draw_bicycle, "kick_scooter": draw_kick_scooter, "pedestrian": draw_pedestrian,
    "child": draw_child, "dog": draw_dog, "pram": draw_pram, "oddity": draw_oddity,
}  # fmt: skip
"""Movable shapes by name."""

COMMON = ("car", "pedestrian")
"""What streets are full of; all other kinds are rare."""

POOL = {"car": 9, "van": 3, "pedestrian": 5, "cyclist": 3, "bicycle": 3}
DEFAULT_POOL = 2


class Catalogue:
    """Draws models by name from a small pool that belongs to one world.

    Args:
        rng: What is drawn comes from here.
        rare: All kinds but the common ones are so many times as likely as is usual.
    """

    def __init__(self, rng: np.random.Generator, rare: float = 1.0) -> None:
        self._rng = rng
        self._rare = rare
        self._pools: dict[str, list[Model]] = {}

    def drawing_from(self, rng: np.random.Generator) -> Catalogue:
        """The shapes so far in a catalogue that draws from another generator; this one stays."""
        other = Catalogue(rng, self._rare)
        other._pools = {name: list(pool) for name, pool in self._pools.items()}
        return other

    def draw(self, name: str) -> Model:
        """A model called ``name`` in ``MAKERS``, with its own paint."""
        pool = self._pools.setdefault(name, [])
        size = POOL.get(name, DEFAULT_POOL)
        choice = int(self._rng.integers(size))
        if choice >= len(pool):
            pool.append(MAKERS[name](self._rng))
            choice = len(pool) - 1
        return pool[choice].repainted(draw_paint(self._rng))

    def draw_any(self, chances: Mapping[str, float]) -> Model:
        """A model of a kind drawn by its chance."""
        weights = np.array(
            [chance * (1.0 if kind in COMMON else self._rare) for kind, chance in chances.items()]
        )
        return self.draw(str(self._rng.choice(list(chances), p=weights / weights.sum())))
