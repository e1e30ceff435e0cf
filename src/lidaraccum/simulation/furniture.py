"""What stands about in streets: poles, signs, stops, bins, benches, kiosks, goods, containers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lidaraccum.simulation.barriers import stairs
from lidaraccum.simulation.mesh import Finish, Mesh, blob, box, extrude, lathe, merge, quads, rod
from lidaraccum.simulation.oddities import random_body
from lidaraccum.simulation.surfaces import Surface
from lidaraccum.simulation.vegetation import bush

STEEL = Finish(Surface.POLE, 0.4)


def _finish(rng: np.random.Generator, surface: Surface = Surface.FURNITURE) -> Finish:
    return Finish(surface, float(rng.uniform(0.08, 0.8)))


def lamp(rng: np.random.Generator) -> Mesh:
    """A street lamp with its arm."""
    height, reach = rng.uniform(4.0, 9.0), rng.uniform(0.0, 2.0)
    return merge(
        [
            lathe([(0.09, -0.1), (0.08, 1.0), (0.04, height)], STEEL, 8),
            rod((0, 0, height), (reach, 0, height + 0.3), 0.04, STEEL),
            box((0.6, 0.25, 0.12), (reach, 0, height + 0.25), STEEL),
        ]
    )


def sign(rng: np.random.Generator) -> Mesh:
    """A traffic sign, round, triangular or square, on its pole."""
    height, size = rng.uniform(1.8, 2.8), rng.uniform(0.3, 0.5)
    corners = int(rng.choice([3, 4, 8]))
    angle = 2 * np.pi * (np.arange(corners) + 0.5) / corners - np.pi / 2
    outline = np.stack([size * np.cos(angle), height + size + size * np.sin(angle)], axis=1)
    plate = extrude(outline, 0.02, Finish(Surface.SIGN, 0.95))
    return merge([rod((0, 0.03, -0.1), (0, 0.03, height + 2 * size), 0.035, STEEL), plate])


def billboard(rng: np.random.Generator) -> Mesh:
    """An advertisement on legs, or a column of them."""
    if rng.random() < 0.4:
        return lathe([(0.65, 0), (0.65, 2.8), (0.75, 2.9), (0.0, 3.3)], _finish(rng), 12)
    width, low = rng.uniform(1.0, 4.0), rng.uniform(0.4, 1.5)
    plate = box((width, 0.12, rng.uniform(1.2, 2.5)), (0, 0, low), _finish(rng, Surface.SIGN))
    legs = [rod((x, 0, -0.1), (x, 0, low), 0.06, STEEL) for x in (-0.4 * width, 0.4 * width)]
    return merge([plate, *legs])


def traffic_light(rng: np.random.Generator) -> Mesh:
    """A traffic light on its pole."""
    height = rng.uniform(2.4, 3.6)
    case = box((0.25, 0.3, 0.85), (0.15, 0, height - 0.8), Finish(Surface.SIGN, 0.1))
    return merge([rod((0, 0, -0.1), (0, 0, height), 0.06, STEEL), case])


def bollards(rng: np.random.Generator) -> Mesh:
    """A few bollards in a row."""
    height, radius, finish = rng.uniform(0.5, 1.1), rng.uniform(0.04, 0.15), _finish(rng)
    profile = [(radius, 0), (radius, height), (0, height + 0.05)]
    post, gap = lathe(profile, finish, 8), rng.uniform(0.8, 1.6)
    return merge(post.moved((gap * k, 0, 0)) for k in range(int(rng.integers(1, 6))))


def bins(rng: np.random.Generator) -> Mesh:
    """Wheeled bins, alone or in a row, of all sizes."""
    large = rng.random() < 0.35
    size = (0.55, 0.6, 1.0) if not large else (1.3, 0.8, 1.25)
    parts = []
    for k in range(int(rng.integers(1, 6))):
        finish = _finish(rng)
        shift = (k * (size[0] + rng.uniform(0.05, 0.3)), rng.uniform(-0.1, 0.1), 0.05)
        body = box((size[0] * 0.85, size[1] * 0.85, size[2]), (0, 0, 0), finish, (1.15, 1.15))
        lid = box((size[0], size[1], 0.08), (0, 0, size[2]), finish, (0.9, 0.7))
        parts.append(merge([body, lid]).moved(shift, rng.uniform(-0.2, 0.2)))
    return merge(parts)


def litter_bin(rng: np.random.Generator) -> Mesh:
    """A litter bin on a foot."""
    radius = rng.uniform(0.18, 0.3)
    return lathe([(0.6 * radius, 0), (radius, 0.2), (radius, 0.9), (0, 1.0)], _finish(rng), 8)


def bench(rng: np.random.Generator) -> Mesh:
    """A bench, mostly with a back."""
    length, finish = rng.uniform(1.2, 2.4), _finish(rng)
    parts = [box((length, 0.45, 0.06), (0, 0, 0.42), finish)]
    parts += [box((0.08, 0.4, 0.42), (x * length, 0, 0), finish) for x in (-0.4, 0.4)]
    if rng.random() < 0.7:
        parts.append(box((length, 0.06, 0.3), (0, -0.22, 0.58), finish))
    return merge(parts)


def table_group(rng: np.random.Generator) -> Mesh:
    """A pavement café: tables, chairs, at times a parasol."""
    finish, parts = _finish(rng), []
    for k in range(int(rng.integers(1, 4))):
        x = 2.2 * k
        parts += [
            box((0.7, 0.7, 0.04), (x, 0, 0.72), finish),
            rod((x, 0, 0), (x, 0, 0.72), 0.05, STEEL),
        ]
        for angle in rng.uniform(0, 2 * np.pi, int(rng.integers(1, 4))):
            seat = merge([box((0.42, 0.42, 0.04), (0, 0, 0.44), finish),
                          box((0.05, 0.42, 0.45), (0.2, 0, 0.46), finish),
                          rod((0, 0, 0), (0, 0, 0.44), 0.1, finish)])  # fmt: skip
            parts.append(seat.moved((x + 0.7 * np.cos(angle), 0.7 * np.sin(angle), 0), angle))
        if rng.random() < 0.4:
            parts.append(lathe([(1.4, 2.2), (0.0, 2.7)], _finish(rng), 8).moved((x, 0, 0)))
    return merge(parts)


def kiosk(rng: np.random.Generator) -> Mesh:
    """A kiosk, a shed, a stall or a site hut, about as large as a van."""
    size = (rng.uniform(1.2, 6.0), rng.uniform(1.2, 2.8), rng.uniform(1.9, 2.9))
    finish = _finish(rng)
    parts = [box(size, (0, 0, 0), finish)]
    parts.append(box((size[0] + 0.4, size[1] + 0.6, 0.12), (0, 0.1, size[2]), finish))
    if rng.random() < 0.5:
        counter = box((0.7 * size[0], 0.4, 0.06), (0, 0.5 * size[1] + 0.2, 1.0), finish)
        parts.append(counter)
    return merge(parts)


def bus_stop(rng: np.random.Generator) -> Mesh:
    """A shelter: roof, glass back and side, a bench."""
    length, depth, glass = rng.uniform(2.5, 5.0), rng.uniform(1.2, 1.8), Finish(Surface.GLASS, 0.1)
    back, side = -0.5 * depth, 0.5 * length
    panes = [
        [(-side, back, 0.2), (side, back, 0.2), (side, back, 2.2), (-side, back, 2.2)],
        [(side, back, 0.2), (side, 0.3, 0.2), (side, 0.3, 2.2), (side, back, 2.2)],
    ]
    posts = [rod((x, back, 0), (x, back, 2.4), 0.05, STEEL) for x in np.linspace(-side, side, 4)]
    roof = box((length + 0.3, depth + 0.3, 0.12), (0, 0.1, 2.35), _finish(rng))
    return merge(
        [quads(np.array(panes), glass), roof, *posts, bench(rng).moved((0, back + 0.5, 0))]
    )


def container(rng: np.random.Generator) -> Mesh:
    """A shipping container, a skip, or a glass bank."""
    finish, choice = _finish(rng), rng.random()
    if choice < 0.4:
        length = float(rng.choice([3.0, 6.06, 12.2]))
        ribs = [box((0.1, 2.48, 2.4), (x, 0, 0.1), finish)
                for x in np.linspace(-0.48 * length, 0.48 * length, int(length / 0.5))]  # fmt: skip
        return merge([box((length, 2.4, 2.55), (0, 0, 0.05), finish), *ribs])
    if choice < 0.75:
        length, height = rng.uniform(2.2, 5.5), rng.uniform(0.9, 1.8)
        tub = box((0.75 * length, 1.7, height), (0, 0, 0.05), finish, (1.33, 1.1))
        heap = blob((0.4 * length, 0.7, 0.4), (0, 0, height), _finish(rng), rng, 0.25)
        return merge([tub, heap])
    drop = lathe([(0.6, 0.1), (0.85, 0.6), (0.8, 1.3), (0.4, 1.65), (0, 1.7)], finish, 10)
    return merge(drop.moved((2.0 * k, 0, 0)) for k in range(int(rng.integers(1, 4))))


def goods(rng: np.random.Generator) -> Mesh:
    """Stacked goods: pallets, pipes, timber, bales, sacks, or a heap of gravel or snow."""
    finish, choice = _finish(rng), int(rng.integers(4))
    if choice == 0:
        pallet = (1.2 * rng.uniform(0.7, 1), 0.8)
        return merge(
            box((*pallet, rng.uniform(0.2, 1.9)), (1.35 * i, 0.95 * j, 0), finish)
            for i in range(int(rng.integers(1, 4)))
            for j in range(int(rng.integers(1, 3)))
        )
    if choice == 1:
        length, radius = rng.uniform(2, 6), rng.uniform(0.08, 0.35)
        return merge(
            rod((-0.5 * length, radius * (2 * k + row), radius * (1 + 1.8 * row)),
                (0.5 * length, radius * (2 * k + row), radius * (1 + 1.8 * row)), radius, finish)
            for row in range(int(rng.integers(1, 4)))
            for k in range(4 - row)
        )  # fmt: skip
    if choice == 2:
        size = rng.uniform(0.6, 1.5)
        return merge(
            lathe([(0, 0), (size / 2, 0.02), (size / 2, size), (0, size + 0.02)], finish, 9).moved(
                (1.1 * size * i, 1.1 * size * j, 0)
            )
            for i in range(int(rng.integers(1, 4)))
            for j in range(int(rng.integers(1, 3)))
        )
    reach = rng.uniform(0.8, 2.8)
    heap = Finish(Surface.GRAVEL, float(rng.uniform(0.2, 0.8)))
    return blob((reach, reach * rng.uniform(0.5, 1.2), reach * rng.uniform(0.3, 0.7)), (0, 0, 0),
                heap, rng, 0.2)  # fmt: skip


def planter(rng: np.random.Generator) -> Mesh:
    """A tub or a raised bed with plants."""
    size = (rng.uniform(0.5, 3.0), rng.uniform(0.5, 1.4), rng.uniform(0.3, 0.8))
    plants = bush(rng, float(rng.uniform(0.4, 1.0)))
    return merge([box(size, (0, 0, 0), _finish(rng), (1.05, 1.1)), plants.moved((0, 0, size[2]))])


def cabinet(rng: np.random.Generator) -> Mesh:
    """A switch cabinet, a ticket machine, a letter box, a transformer."""
    size = (rng.uniform(0.4, 2.2), rng.uniform(0.3, 1.2), rng.uniform(0.9, 2.0))
    return merge(
        [
            box(size, (0, 0, 0), _finish(rng)),
            box((size[0] + 0.1, size[1] + 0.1, 0.06), (0, 0, size[2]), STEEL),
        ]
    )


def cycle_rack(rng: np.random.Generator) -> Mesh:
    """Hoops to lean bicycles on, without any."""
    parts = []
    for k in range(int(rng.integers(2, 7))):
        x = 0.9 * k
        parts += [rod((x, y, 0), (x, y, 0.8), 0.03, STEEL) for y in (-0.4, 0.4)]
        parts.append(rod((x, -0.4, 0.8), (x, 0.4, 0.8), 0.03, STEEL))
    return merge(parts)


def statue(rng: np.random.Generator) -> Mesh:
    """A monument on its plinth, a fountain, a boulder."""
    if rng.random() < 0.4:
        radius = rng.uniform(0.4, 1.6)
        return blob(
            (radius, 0.8 * radius, 0.7 * radius), (0, 0, 0.2 * radius), _finish(rng), rng, 0.2
        )
    plinth = box((1.4, 1.4, 1.2), (0, 0, 0), _finish(rng), (0.8, 0.8))
    return merge([plinth, random_body(rng, Surface.FURNITURE).moved((0, 0, 1.2))])


def swings(rng: np.random.Generator) -> Mesh:
    """A playground's frame, or a scaffold."""
    length, height = rng.uniform(2, 6), rng.uniform(2, 5)
    parts = []
    for x in np.arange(0, length, 1.6):
        parts += [rod((x, y, 0), (x, 0.2 * y, height), 0.04, STEEL) for y in (-0.8, 0.8)]
    parts.append(rod((0, 0, height), (length, 0, height), 0.05, STEEL))
    if rng.random() < 0.5:
        parts.append(box((1.4, 1.0, 0.1), (0.8, 0, 1.3), _finish(rng)))
    return merge(parts)


def clutter(rng: np.random.Generator) -> Mesh:
    """A static thing of no particular kind, from the same solids as odd movers."""
    return random_body(rng, Surface.FURNITURE)


KERB_SIDE: tuple[Callable[[np.random.Generator], Mesh], ...] = (
    lamp, sign, sign, bollards, litter_bin, cabinet, traffic_light, bins, planter, cycle_rack,
)  # fmt: skip
"""Slim things at the outer edge of a pavement."""

CAR_SIZED: tuple[Callable[[np.random.Generator], Mesh], ...] = (
    bins, bench, kiosk, bus_stop, container, goods, planter, cabinet, statue, table_group, bush,
    bush, stairs, swings, billboard, clutter, clutter, goods, container,
)  # fmt: skip
"""Things of about a car's size, which are not cars."""

FURNITURE = frozenset({*KERB_SIDE, *CAR_SIZED} - {bush})
"""What is neither built, grown nor movable."""
