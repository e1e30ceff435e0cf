"""Buildings with depth: windows set back, balconies, doors, eaves, gables, rooms behind glass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Finish, Mesh, box, merge, quads, rod
from lidaraccum.simulation.surfaces import Surface

Array = NDArray[np.float64]


def draw_building(width: float, depth: float, storeys: int, rng: np.random.Generator) -> Mesh:
    """A building whose front stands on y = 0 and looks towards -y; x runs along the street."""
    storey, finish = rng.uniform(2.6, 3.6), Finish(Surface.BUILDING, float(rng.uniform(0.15, 0.7)))
    height = storeys * storey + rng.uniform(0.2, 0.8)
    parts = [
        _facade(width, height, storeys, storey, finish, rng),
        _shell(width, depth, height, finish),
        _roof(width, depth, height, rng),
    ]
    parts += _balconies(width, storeys, storey, rng)
    parts += _extras(width, height, rng)
    return merge(parts)


def _facade(
    width: float, height: float, storeys: int, storey: float, finish: Finish,
    rng: np.random.Generator,
) -> Mesh:  # fmt: skip
    """The front as a lattice of wall and window cells; windows lie behind the wall's face."""
    bays = max(int(width / rng.uniform(1.8, 3.6)), 1)
    share, recess = rng.uniform(0.35, 0.7), rng.uniform(0.08, 0.35)
    sill, head = rng.uniform(0.25, 0.4), rng.uniform(0.75, 0.9)
    if rng.random() < 0.3:
        sill = 0.05
    x = np.linspace(-0.5 * width, 0.5 * width, bays + 1)
    left = x[:-1] + 0.5 * (1 - share) * np.diff(x)
    right = left + share * np.diff(x)
    floor = storey * np.arange(storeys)
    low, high = floor + sill * storey, floor + head * storey
    wall = [_upright(np.array([-0.5 * width]), np.array([0.5 * width]), bottom, top, 0.0)
            for bottom, top in zip(np.r_[-1.0, high], np.r_[low, height], strict=True)]  # fmt: skip
    piers = (np.r_[-0.5 * width, right], np.r_[left, 0.5 * width])
    wall += [_upright(*piers, bottom, top, 0.0) for bottom, top in zip(low, high, strict=True)]
    parts = [quads(np.concatenate(wall), finish)]
    panes = np.concatenate(
        [_upright(left, right, a, b, recess) for a, b in zip(low, high, strict=True)]
    )
    shut = rng.random(len(panes)) < rng.choice([0.0, 0.2, 0.6])
    parts.append(quads(panes[~shut], Finish(Surface.GLASS, 0.1)))
    parts.append(quads(panes[shut], Finish(Surface.BUILDING, float(rng.uniform(0.3, 0.7)))))
    parts.append(quads(_reveals(panes, recess), finish))
    behind = np.zeros((len(panes), 1, 3))
    behind[:, 0, 1] = rng.uniform(0.4, 2.5, len(panes))
    room = panes + behind
    parts.append(quads(_widened(room, 0.3), Finish(Surface.BUILDING, 0.3)))
    return merge(parts)


def _upright(left: Array, right: Array, low: float, high: float, y: float) -> Array:
    """(Q, 4, 3) upright rectangles between lefts and rights (Q,)."""
    corners = np.zeros((len(left), 4, 3))
    corners[:, :, 1] = y
    corners[:, [0, 3], 0], corners[:, [1, 2], 0] = left[:, None], right[:, None]
    corners[:, :2, 2], corners[:, 2:, 2] = low, high
    return corners


def _reveals(panes: Array, recess: float) -> Array:
    """(4 Q, 4, 3): the four sides that lead from the wall's face to each pane."""
    front = panes - np.array([0.0, recess, 0.0])
    after = np.roll(np.arange(4), -1)
    return np.stack([front, front[:, after], panes[:, after], panes], axis=2).reshape(-1, 4, 3)


def _widened(panes: Array, by: float) -> Array:
    middle = panes.mean(axis=1, keepdims=True)
    return middle + (panes - middle) * (1 + by)


def _shell(width: float, depth: float, height: float, finish: Finish) -> Mesh:
    """Sides, back and flat top."""
    x, y = 0.5 * width, depth
    sides = [
        [(-x, 0, -1), (-x, y, -1), (-x, y, height), (-x, 0, height)],
        [(x, 0, -1), (x, y, -1), (x, y, height), (x, 0, height)],
        [(-x, y, -1), (x, y, -1), (x, y, height), (-x, y, height)],
        [(-x, 0, height), (x, 0, height), (x, y, height), (-x, y, height)],
    ]
    return quads(np.array(sides, dtype=np.float64), finish)


def _roof(width: float, depth: float, height: float, rng: np.random.Generator) -> Mesh:
    """A gable along or across, with eaves and a chimney; or a parapet."""
    tiles = Finish(Surface.BUILDING, float(rng.uniform(0.1, 0.4)))
    if depth > 16 or rng.random() < 0.3:
        return box((width + 0.2, 0.25, 0.6), (0, 0.05, height), tiles)
    rise, eave = rng.uniform(0.25, 0.6) * 0.5 * depth, rng.uniform(0.2, 0.7)
    x, front, back, middle = 0.5 * width + eave, -eave, depth + eave, 0.5 * depth
    low = height - eave * rise / middle
    planes = [
        [
            (-x, front, low),
            (x, front, low),
            (x, middle, height + rise),
            (-x, middle, height + rise),
        ],
        [(-x, back, low), (x, back, low), (x, middle, height + rise), (-x, middle, height + rise)],
    ]
    gables = [
        [(s, 0, height), (s, depth, height), (s, middle, height + rise), (s, middle, height + rise)]
        for s in (-0.5 * width, 0.5 * width)
    ]
    chimney = box(
        (0.6, 0.6, 1.5), (rng.uniform(-0.3, 0.3) * width, middle, height + 0.7 * rise), tiles
    )
    return merge([quads(np.array(planes), tiles), quads(np.array(gables), tiles), chimney])


def _balconies(width: float, storeys: int, storey: float, rng: np.random.Generator) -> list[Mesh]:
    if storeys < 2 or rng.random() > 0.4:
        return []
    slab = Finish(Surface.BUILDING, 0.4)
    front = Finish(Surface.MESH_FENCE if rng.random() < 0.5 else Surface.BUILDING, 0.4)
    across, out = rng.uniform(1.5, 3.5), rng.uniform(0.7, 1.6)
    columns = np.arange(
        -0.5 * width + across, 0.5 * width - 0.5 * across, across * rng.uniform(1.4, 3)
    )
    parts = []
    for level in range(1, storeys):
        for x in columns:
            parts.append(box((across, out, 0.15), (x, -0.5 * out, level * storey), slab))
            parts.append(box((across, 0.04, 1.0), (x, -out, level * storey + 0.15), front))
    return parts


def _extras(width: float, height: float, rng: np.random.Generator) -> list[Mesh]:
    """A step, a canopy, an awning, a down-pipe, a shop sign."""
    finish = Finish(Surface.BUILDING, float(rng.uniform(0.1, 0.6)))
    x = rng.uniform(-0.4, 0.4) * width
    parts = [rod((0.48 * width, -0.08, 0), (0.48 * width, -0.08, height), 0.05, finish)]
    if rng.random() < 0.5:
        parts.append(box((1.6, rng.uniform(0.6, 1.6), 0.1), (x, -0.5, 2.4), finish))
    if rng.random() < 0.6:
        parts.append(box((rng.uniform(1.2, 2.4), 0.9, 0.3), (x, -0.45, 0.0), finish))
    if rng.random() < 0.25:
        parts.append(box((0.9 * width, 1.3, 0.08), (0, -0.7, 2.7), finish))
    return parts


def draw_garage(rng: np.random.Generator) -> Mesh:
    """A garage, a carport or a shed; front on y = 0."""
    width, depth, height = rng.uniform(2.6, 6.0), rng.uniform(4.5, 6.5), rng.uniform(2.1, 2.8)
    finish = Finish(Surface.BUILDING, float(rng.uniform(0.2, 0.6)))
    roof = box((width + 0.3, depth + 0.3, 0.15), (0, 0.5 * depth, height), finish)
    if rng.random() < 0.4:
        posts = [box((0.12, 0.12, height), (s * 0.48 * width, y, 0), finish)
                 for s in (-1, 1) for y in (0.1, depth - 0.1)]  # fmt: skip
        return merge([roof, *posts])
    return merge([roof, box((width, depth, height), (0, 0.5 * depth, -0.2), finish)])
