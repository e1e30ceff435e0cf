"""Two-wheelers with and without riders: bicycles, cargo bikes, motorcycles, kick scooters."""

from __future__ import annotations

import numpy as np

from lidaraccum.simulation.bodies import TYRE
from lidaraccum.simulation.mesh import Finish, Mesh, blob, box, disc_wheel, grid, merge, rod
from lidaraccum.simulation.models import Model, of_parts
from lidaraccum.simulation.people import cloth, draw_pedestrian, sitting
from lidaraccum.simulation.surfaces import Surface


def hoop(centre: tuple[float, float, float], radius: float, width: float, finish: Finish) -> Mesh:
    """A bicycle's rim and tyre: a ring in the x-z plane that one sees through."""
    angle = np.linspace(0, 2 * np.pi, 15)[:-1]
    around = np.stack([np.cos(angle), np.zeros(14), np.sin(angle)], axis=1)
    side = np.array([0.0, 0.5 * width, 0.0])
    rows = [radius * around - side, radius * around + side, (radius - 0.05) * around + side,
            (radius - 0.05) * around - side, radius * around - side]  # fmt: skip
    return grid(np.stack(rows) + np.asarray(centre), finish, closed=True)


def _bicycle(rng: np.random.Generator) -> Mesh:
    frame = Finish(Surface.CYCLE, float(rng.uniform(0.1, 0.6)))
    size = rng.uniform(0.85, 1.05)
    radius = 0.34
    back, front = (-0.5, 0.0, radius), (0.55, 0.0, radius)
    crank, saddle, head = (-0.08, 0, 0.3), (-0.2, 0, 0.85), (0.42, 0, 0.85)
    tubes = [(back, crank), (crank, saddle), (crank, head), (saddle, head), (back, saddle),
             (head, front), (head, (0.4, 0, 1.0))]  # fmt: skip
    parts = [rod(start, end, 0.022, frame) for start, end in tubes]
    parts += [hoop(back, radius, 0.045, TYRE), hoop(front, radius, 0.045, TYRE)]
    parts.append(rod((0.4, -0.28, 1.0), (0.4, 0.28, 1.0), 0.018, frame))
    parts.append(box((0.24, 0.14, 0.06), (-0.22, 0, 0.9), frame))
    if rng.random() < 0.3:
        parts.append(box((0.35, 0.3, 0.28), (-0.5, 0, 0.72), cloth(rng)))
    if rng.random() < 0.15:
        parts.append(box((0.6, 0.55, 0.5), (0.95, 0, 0.3), cloth(rng), (1.1, 1.1)))
        parts.append(hoop((1.35, 0, 0.25), 0.25, 0.045, TYRE))
    return merge(parts).moved((0, 0, 0), 0.0, size)


def draw_cyclist(rng: np.random.Generator) -> Model:
    """A bicycle and who rides it."""
    rider = sitting(rng, 0.93, rng.uniform(0.1, 0.8), 0.4).moved((-0.2, 0, 0))
    return of_parts("Cyclist", _bicycle(rng), rider)


def draw_bicycle(rng: np.random.Generator) -> Model:
    """A bicycle left standing."""
    return of_parts("Bicycle", _bicycle(rng))


def _motorcycle(rng: np.random.Generator) -> Mesh:
    paint = Finish(Surface.CAR_PAINT, float(rng.uniform(0.05, 0.6)))
    scooter = rng.random() < 0.5
    radius = 0.23 if scooter else 0.31
    base = 0.62 if scooter else 0.72
    parts = [disc_wheel((x, 0, radius), radius, 0.13, TYRE) for x in (-base, base)]
    parts += [
        blob((0.5, 0.16, 0.22), (-0.2, 0, 0.55), paint, rng, 0.08),
        blob((0.3, 0.17, 0.18), (0.2, 0, 0.78), paint, rng, 0.08),
        box((0.7, 0.26, 0.1), (-0.4, 0, 0.76), Finish(Surface.TRIM, 0.08)),
        rod((base, 0, radius), (0.42, 0, 1.0), 0.05, paint),
        rod((0.4, -0.36, 1.02), (0.4, 0.36, 1.02), 0.025, paint),
    ]
    if scooter or rng.random() < 0.4:
        parts.append(box((0.12, 0.4, 0.6), (0.5, 0, 0.4), paint, (0.5, 0.7)))
    if rng.random() < 0.35:
        parts.append(box((0.42, 0.42, 0.35), (-0.8, 0, 0.85), cloth(rng)))
    return merge(parts)


def draw_motorcyclist(rng: np.random.Generator) -> Model:
    """A motorcycle or a scooter and who rides it."""
    rider = sitting(rng, 0.85, rng.uniform(0.0, 0.6), 0.55).moved((-0.25, 0, 0))
    return of_parts("Motorcycle", _motorcycle(rng), rider)


def draw_motorcycle(rng: np.random.Generator) -> Model:
    """A motorcycle left standing."""
    return of_parts("Motorcycle", _motorcycle(rng))


def draw_kick_scooter(rng: np.random.Generator) -> Model:
    """Someone standing on a kick scooter."""
    frame = Finish(Surface.CYCLE, 0.3)
    rider = draw_pedestrian(rng).mesh.moved((0, 0, 0.15))
    deck = [
        box((0.9, 0.14, 0.06), (0, 0, 0.1), frame),
        rod((0.45, 0, 0.1), (0.35, 0, 1.1), 0.025, frame),
        rod((0.35, -0.25, 1.1), (0.35, 0.25, 1.1), 0.02, frame),
        disc_wheel((0.45, 0, 0.1), 0.1, 0.04, TYRE),
        disc_wheel((-0.45, 0, 0.1), 0.1, 0.04, TYRE),
    ]
    return of_parts("Cyclist", rider, *deck)
