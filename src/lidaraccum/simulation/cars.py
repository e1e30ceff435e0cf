"""Cars of several body types, vans and pick-ups, drawn by seed."""

from __future__ import annotations

import numpy as np

from lidaraccum.simulation.bodies import BodyShape, body, mirrors, seats, wheels
from lidaraccum.simulation.mesh import Finish, Mesh, box, merge, rod
from lidaraccum.simulation.models import Model, of_parts
from lidaraccum.simulation.surfaces import Surface

CAR_TYPES = ("hatchback", "saloon", "estate", "suv", "coupe", "microcar", "mpv", "pickup")


def draw_paint(rng: np.random.Generator) -> float:
    """Reflectivity of car paint: black, grey, coloured, white."""
    return float(rng.choice([0.03, 0.06, 0.15, 0.3, 0.5, 0.75]) * rng.uniform(0.8, 1.2))


_LENGTHS = {
    "hatchback": (3.6, 4.4, 1.42, 1.55), "saloon": (4.4, 5.1, 1.38, 1.5),
    "estate": (4.4, 5.0, 1.42, 1.55), "suv": (4.2, 5.1, 1.6, 1.9),
    "coupe": (4.0, 4.7, 1.2, 1.36), "microcar": (2.5, 3.5, 1.45, 1.6),
    "mpv": (4.3, 5.1, 1.65, 1.9), "pickup": (5.0, 5.8, 1.75, 1.95),
}  # fmt: skip


def draw_car(rng: np.random.Generator, kind: str | None = None) -> Model:
    """A car; its body type is drawn too unless told."""
    weights = [0.27, 0.17, 0.15, 0.2, 0.05, 0.04, 0.08, 0.04]
    kind = kind or str(rng.choice(CAR_TYPES, p=weights))
    shortest, longest, lowest, highest = _LENGTHS[kind]
    length, height = rng.uniform(shortest, longest), rng.uniform(lowest, highest)
    width = float(np.clip(0.25 * length + rng.uniform(0.62, 0.78), 1.5, 2.05))
    shape = _shape(kind, length, width, height, rng)
    cabin = [x for x, _ in shape.outline]
    front_seat = 0.5 * (shape.side_glass[0] + shape.pillars[0]) - 0.2
    rows = (front_seat,) if kind in ("coupe", "microcar") else (front_seat, front_seat - 0.9)
    parts = [
        body(shape),
        wheels(shape),
        mirrors(shape.side_glass[0] - 0.1, width, 0.62 * height),
        seats(rows, width, shape.clearance + 0.15),
    ]
    if kind in ("suv", "estate") and rng.random() < 0.4:
        rail = Finish(Surface.TRIM, 0.3)
        parts += [
            rod((cabin[3], y, height + 0.05), (cabin[4], y, height + 0.05), 0.03, rail)
            for y in (-0.36 * width, 0.36 * width)
        ]
    if rng.random() < 0.06:
        parts.append(_roof_load(rng, cabin[3], cabin[4], height))
    return of_parts("Car", *parts)


def _roof_load(rng: np.random.Generator, front: float, rear: float, height: float) -> Mesh:
    size = (rng.uniform(1.0, 1.9), rng.uniform(0.5, 0.9), rng.uniform(0.25, 0.45))
    return box(
        size, (0.5 * (front + rear), 0.0, height + 0.05), Finish(Surface.TRIM, 0.2), (0.9, 0.8)
    )


def _shape(
    kind: str, length: float, width: float, height: float, rng: np.random.Generator
) -> BodyShape:
    nose, tail = 0.5 * length, -0.5 * length
    bonnet_z = height * rng.uniform(0.6, 0.68) if kind not in ("coupe",) else height * 0.62
    bonnet = length * {"microcar": 0.13, "mpv": 0.17, "saloon": 0.26, "coupe": 0.3}.get(kind, 0.23)
    screen = rng.uniform(0.55, 0.85) * (height - bonnet_z) * 1.55
    scuttle, roof = nose - bonnet, nose - bonnet - screen
    deck = height * rng.uniform(0.62, 0.7)
    rear = _rear(kind, tail, height, deck, length, roof, rng)
    outline = (
        (nose, 0.42 * height),
        (nose - 0.06, bonnet_z * 0.88),
        (scuttle, bonnet_z),
        (roof, height * 0.985),
        *rear,
        (tail, 0.45 * height),
    )
    wheel = rng.uniform(0.29, 0.34) * (1.15 if kind in ("suv", "pickup") else 1.0)
    belt_z = bonnet_z * rng.uniform(0.97, 1.03)
    last_roof = rear[0][0] if kind == "pickup" else rear[1][0]
    doors = roof + 0.3 - np.array([0.95, 1.85])
    pillars = tuple(float(x) for x in doors if x > last_roof + 0.15) or (roof - 0.5,)
    return BodyShape(
        outline=outline,
        belt=((nose, 0.4 * height), (scuttle, belt_z), (tail, belt_z * 1.05)),
        width=width,
        taper=rng.uniform(0.72, 0.85),
        clearance=rng.uniform(0.14, 0.2) + 0.08 * (kind in ("suv", "pickup")),
        wheels=(nose - rng.uniform(0.75, 0.95) * length / 4.4, tail + 0.8 * length / 4.4),
        wheel_radius=wheel,
        pillars=pillars,
        rounding=rng.uniform(0.08, 0.2),
        paint=draw_paint(rng),
        side_glass=(scuttle - 0.25, last_roof - 0.1),
    )


def _rear(
    kind: str, tail: float, height: float, deck: float, length: float, roof: float,
    rng: np.random.Generator,
) -> tuple[tuple[float, float], ...]:  # fmt: skip
    """Outline from the highest point of the roof to the tail."""
    crown = (roof - 0.25 * (roof - tail), height)
    if kind in ("saloon", "coupe"):
        boot = length * rng.uniform(0.12, 0.16)
        fall = rng.uniform(0.5, 0.8)
        return (
            crown,
            (tail + boot + fall, height * 0.96),
            (tail + boot, deck),
            (tail + 0.05, deck),
        )
    if kind == "pickup":
        bed = length * rng.uniform(0.27, 0.33)
        return (
            (tail + bed + 0.25, height), (tail + bed, deck * 0.98), (tail + bed - 0.06, deck * 0.9),
            (tail + 0.02, deck * 0.9),
        )  # fmt: skip
    fall = rng.uniform(0.12, 0.3) if kind in ("estate", "mpv", "suv") else rng.uniform(0.25, 0.5)
    return (
        crown,
        (tail + 0.12 + fall, height * 0.97),
        (tail + 0.1, deck),
        (tail + 0.03, deck * 0.8),
    )


def draw_van(rng: np.random.Generator) -> Model:
    """A delivery van or a minibus."""
    length, height = rng.uniform(4.6, 6.6), rng.uniform(1.9, 2.7)
    width = rng.uniform(1.85, 2.1)
    nose, tail = 0.5 * length, -0.5 * length
    bonnet, screen = rng.uniform(0.4, 0.9), rng.uniform(0.5, 0.8)
    scuttle, roof = nose - bonnet, nose - bonnet - screen
    windows = rng.random() < 0.35
    shape = BodyShape(
        outline=(
            (nose, 0.55), (nose - 0.05, 0.95), (scuttle, 1.2), (roof, height * 0.94),
            (roof - 0.5, height), (tail + 0.1, height), (tail + 0.02, height * 0.9), (tail, 0.6),
        ),
        belt=((nose, 0.6), (scuttle, 1.15), (tail, 1.25)),
        width=width,
        taper=rng.uniform(0.85, 0.95),
        clearance=rng.uniform(0.2, 0.3),
        wheels=(nose - rng.uniform(0.8, 1.0), tail + rng.uniform(0.8, 1.2)),
        wheel_radius=rng.uniform(0.32, 0.37),
        pillars=(roof - 0.6, roof - 1.6, roof - 2.5) if windows else (roof - 0.6,),
        rounding=rng.uniform(0.04, 0.1),
        paint=float(rng.choice([draw_paint(rng), 0.7])),
        side_glass=(scuttle - 0.2, tail + 0.25 if windows else roof - 0.6),
    )  # fmt: skip
    inside = seats((roof + 0.1,), width, 0.55)
    return of_parts(
        "Van", merge([body(shape), wheels(shape), inside]), mirrors(scuttle - 0.2, width, 1.25)
    )
