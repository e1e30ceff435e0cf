"""Movers outside the usual classes, so that motion is not tied to shape."""

from __future__ import annotations

import numpy as np

from lidaraccum.simulation.bodies import TYRE
from lidaraccum.simulation.mesh import Finish, Mesh, blob, box, disc_wheel, lathe, merge, rod
from lidaraccum.simulation.models import Model, of_parts
from lidaraccum.simulation.surfaces import Surface


def random_body(rng: np.random.Generator, surface: Surface) -> Mesh:
    """One to five solids leaning against each other: nothing in particular.

    Static clutter is made of the same bodies, so shape alone does not tell which one moves.
    """
    scale = float(np.exp(rng.uniform(np.log(0.35), np.log(1.8))))
    parts = []
    for number in range(int(rng.integers(1, 6))):
        finish = Finish(surface, float(rng.uniform(0.05, 0.8)))
        size = scale * rng.uniform(0.5 if number == 0 else 0.3, 1.2, 3)
        x, y = scale * rng.uniform(-0.5, 0.5, 2)
        kind = int(rng.integers(4 if number else 3))
        if kind == 0:
            top = (float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.5, 1.0)))
            part = box((size[0], size[1], size[2]), (0, 0, 0), finish, top)
        elif kind == 1:
            part = blob((size[0] / 2, size[1] / 2, size[2] / 2), (0, 0, size[2] / 2), finish, rng)
        elif kind == 2:
            lower, upper = rng.uniform(0.2, 0.6, 2) * size[0]
            part = lathe([(0, 0), (lower, 0), (upper, size[2]), (0, size[2])], finish, 8)
        else:
            part = rod((0, 0, 0), (0.3 * size[0], 0.3 * size[1], 1.6 * size[2]), 0.06, finish)
        lift = 0.4 * scale * rng.random() * (rng.random() < 0.4)
        parts.append(part.moved((x, y, lift), rng.uniform(0, 2 * np.pi)))
    return merge(parts)


def draw_oddity(rng: np.random.Generator) -> Model:
    """A rolling cart, a pallet truck, a machine, or a thing that has no name."""
    choice = rng.random()
    if choice < 0.45:
        return of_parts("Other", random_body(rng, Surface.CARGO).moved((0, 0, 0.05)))
    length, width = rng.uniform(0.8, 2.6), rng.uniform(0.6, 1.6)
    bed = rng.uniform(0.2, 0.6)
    frame = Finish(Surface.CYCLE, 0.3)
    parts = [box((length, width, 0.12), (0, 0, bed), frame)]
    parts += [
        disc_wheel((x, y, 0.15), 0.15, 0.08, TYRE)
        for x in (-0.4 * length, 0.4 * length)
        for y in (-0.4 * width, 0.4 * width)
    ]
    parts.append(rod((-0.5 * length, 0, bed), (-0.5 * length - 0.5, 0, 1.05), 0.03, frame))
    if choice < 0.85:
        load = random_body(rng, Surface.CARGO)
        low, high = load.bounds
        fit = 0.8 * min(length, width) / float(max(high[0] - low[0], high[1] - low[1], 0.3))
        parts.append(load.moved((0, 0, bed + 0.12), 0.0, fit))
    return of_parts("Other", *parts)
