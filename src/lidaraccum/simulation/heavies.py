"""Lorries with gaps, buses, trams and what is towed, drawn by seed."""

from __future__ import annotations

import numpy as np

from lidaraccum.simulation.bodies import TRIM, TYRE, BodyShape, body, mirrors, seats, wheels
from lidaraccum.simulation.cars import draw_paint
from lidaraccum.simulation.mesh import Finish, Mesh, blob, box, disc_wheel, lathe, merge, rod
from lidaraccum.simulation.models import Model, of_parts
from lidaraccum.simulation.surfaces import Surface

LOADS = ("box", "curtain", "flat", "tank", "container", "tipper", "logs", "mixer")


def draw_truck(rng: np.random.Generator) -> Model:
    """A rigid lorry or an articulated one, with a gap behind its cab."""
    cab_length, width = rng.uniform(1.7, 2.4), rng.uniform(2.2, 2.55)
    height, bed = rng.uniform(2.4, 3.6), rng.uniform(0.9, 1.25)
    load = rng.uniform(4.0, 8.0) if rng.random() < 0.7 else rng.uniform(9.0, 13.6)
    gap = rng.uniform(0.25, 1.0)
    nose = 0.5 * (cab_length + gap + load)
    rear = nose - cab_length - gap
    frame = box((cab_length + gap + load - 0.6, 0.9, 0.25), (-0.2, 0, bed - 0.3), TRIM)
    count = 2 if load > 7 else 1
    axles = [nose - 0.9 * cab_length / 2, *(rear - load + 1.2 + 1.3 * np.arange(count))]
    if load > 9:
        axles.append(rear - 0.5)
    radius = rng.uniform(0.42, 0.52)
    tyres = [
        disc_wheel((float(x), side * (0.5 * width - 0.2), radius), radius, 0.35, TYRE)
        for x in axles
        for side in (-1, 1)
    ]
    cab = _cab(cab_length, width * 0.97, height, draw_paint(rng)).moved(
        (nose - 0.5 * cab_length, 0, 0)
    )
    kind = str(rng.choice(LOADS))
    cargo = _load(kind, load, width, rng.uniform(1.4, 2.7), rng).moved((rear - 0.5 * load, 0, bed))
    guards = [
        box((0.5 * load, 0.05, 0.35), (rear - 0.45 * load, side * 0.48 * width, 0.45), TRIM)
        for side in (-1, 1)
        if rng.random() < 0.7
    ]
    return of_parts("Truck", frame, *tyres, cab, cargo, *guards)


def _cab(length: float, width: float, height: float, paint: float) -> Mesh:
    nose, tail = 0.5 * length, -0.5 * length
    shape = BodyShape(
        outline=((nose, 0.7), (nose - 0.02, 1.3), (nose - 0.06, 1.5), (nose - 0.3, height * 0.97),
                 (tail + 0.1, height), (tail, 0.9)),
        belt=((nose, 0.8), (nose - 0.1, 1.45), (tail, 1.5)),
        width=width, taper=0.95, clearance=0.45, wheels=(), wheel_radius=0.4, pillars=(0.0,),
        rounding=0.06, paint=paint, side_glass=(nose - 0.3, -0.05),
    )  # fmt: skip
    return merge([body(shape), mirrors(nose - 0.15, width, 1.7), seats((0.0,), width, 1.0)])


def _load(kind: str, length: float, width: float, height: float, rng: np.random.Generator) -> Mesh:
    finish = Finish(Surface.CARGO, float(rng.uniform(0.1, 0.8)))
    floor = box((length, width, 0.15), (0, 0, 0), TRIM)
    if kind in ("box", "container", "curtain"):
        sag = (1.0, 1.0) if kind != "curtain" else (0.99, 0.96)
        parts = [floor, box((length, width, height), (0, 0, 0.1), finish, sag)]
        ribs = int(length / 0.6) if kind == "container" else 0
        parts += [
            box((0.12, width + 0.08, height), (x, 0, 0.1), finish)
            for x in np.linspace(-0.48 * length, 0.48 * length, ribs)
        ]
        return merge(parts)
    if kind == "tank":
        radius = 0.48 * width
        ends = [(0.0, 0.0), (0.8 * radius, 0.15), (radius, 0.4), (radius, length - 0.4),
                (0.8 * radius, length - 0.15), (0.0, length)]  # fmt: skip
        tank = lathe(ends, Finish(Surface.CARGO, 0.5), 12)
        x, y, z = tank.vertices.T
        lying = np.stack([z - 0.5 * length, y, x + radius + 0.15], axis=1)
        return merge([floor, tank.with_vertices(lying)])
    if kind == "logs":
        rods = [
            rod((-0.48 * length, y, z), (0.48 * length, y, z), 0.2, finish)
            for z in np.arange(0.3, height, 0.4)
            for y in np.arange(-0.4 * width, 0.41 * width, 0.42)
        ]
        return merge([floor, *rods])
    if kind == "mixer":
        drum = lathe([(0.3, 0), (1.05, 0.3 * length), (1.1, 0.6 * length), (0.4, length)], finish)
        x, y, z = drum.vertices.T
        return merge([floor, drum.with_vertices(np.stack([0.5 * length - z, y, x + 1.2], axis=1))])
    walls = rng.uniform(0.4, 1.4) if kind == "tipper" else 0.0
    parts = [floor]
    parts += [
        box((length, 0.08, walls), (0, side * 0.49 * width, 0.15), finish)
        for side in (-1, 1)
        if walls
    ]
    pieces = int(rng.integers(0, 4))
    for x in np.linspace(-0.35 * length, 0.35 * length, max(pieces, 1))[:pieces]:
        size = (rng.uniform(0.8, 2.0), rng.uniform(0.8, 0.8 * width), rng.uniform(0.4, 1.5))
        if rng.random() < 0.5:
            parts.append(box(size, (x, 0, 0.15), finish))
        else:
            parts.append(blob((size[0] / 2, size[1] / 2, size[2] / 2), (x, 0, 0.4), finish, rng))
    return merge(parts)


def draw_bus(rng: np.random.Generator, category: str = "Bus") -> Model:
    """A bus; as a tram it is longer, narrower in front and has no wheels to see."""
    tram = category == "Tram"
    length = rng.uniform(18, 30) if tram else rng.uniform(8.5, 18)
    width, height = rng.uniform(2.4, 2.6), rng.uniform(2.9, 3.5)
    nose, tail = 0.5 * length, -0.5 * length
    front = 0.7 if tram else 0.25
    shape = BodyShape(
        outline=((nose, 0.6), (nose - 0.05, 1.1), (nose - front, height * 0.93),
                 (nose - front - 0.4, height), (tail + front + 0.4, height),
                 (tail + front, height * 0.93), (tail, 0.7)),
        belt=((nose, 0.9), (nose - 0.3, 1.25), (tail, 1.3)),
        width=width, taper=0.94, clearance=0.28,
        wheels=() if tram else (nose - 2.4, tail + 3.0), wheel_radius=0.48,
        pillars=tuple(float(x) for x in np.arange(tail + 1.5, nose - 1.0, 1.6)),
        rounding=0.12 if tram else 0.03, paint=draw_paint(rng),
        side_glass=(nose - 0.5, tail + 0.8),
    )  # fmt: skip
    parts = [body(shape), wheels(shape, 0.3), mirrors(nose - 0.1, width, 2.0)]
    parts += [seats((float(x),), width, 0.7) for x in np.arange(tail + 1.5, nose - 1.5, 1.6)]
    units = rng.integers(0, 4)
    parts += [
        box((1.5, 1.4, 0.3), (x, 0, height), TRIM)
        for x in rng.uniform(tail + 2, nose - 2, int(units))
    ]
    if tram:
        top = height + 1.2
        parts += [rod((0.0, 0, height), (0.8, 0, top), 0.04, TRIM),
                  rod((0.8, -0.8, top), (0.8, 0.8, top), 0.04, TRIM)]  # fmt: skip
    return of_parts(category, *parts)


def draw_trailer(rng: np.random.Generator) -> Model:
    """A trailer standing or towed alone: flat, box or a caravan."""
    length, width = rng.uniform(1.8, 5.5), rng.uniform(1.3, 2.3)
    finish = Finish(Surface.CARGO, float(rng.uniform(0.15, 0.8)))
    height = rng.uniform(0.35, 2.2)
    parts = [
        box((length, width, height), (0, 0, 0.5), finish, (0.96, 0.94)),
        rod((0.5 * length, 0, 0.55), (0.5 * length + 1.2, 0, 0.5), 0.05, TRIM),
    ]
    parts += [disc_wheel((-0.1, side * 0.5 * width, 0.3), 0.3, 0.2, TYRE) for side in (-1, 1)]
    return of_parts("Trailer", *parts)
