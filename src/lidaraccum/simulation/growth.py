"""What grows from the ground up: shrubs, low crowns, clipped blocks, wild hedges, ivy on fences.

Trees whose crowns begin above the sensor's view return little; gardens return leaves from the
ground on, in bodies as large as a car or a person.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.barriers import boards, pickets, railing, wall, wire_mesh
from lidaraccum.simulation.mesh import Finish, Mesh, blob, box, flakes, grid, merge, rod
from lidaraccum.simulation.surfaces import Surface
from lidaraccum.simulation.vegetation import on_line, shell

Array = NDArray[np.float64]
Barrier = Callable[[Array, np.random.Generator], Mesh]

GROWN_OVER: tuple[Barrier, ...] = (boards, pickets, railing, wall, wire_mesh)
"""What ivy and shrubs climb on."""


def _leaf(rng: np.random.Generator, surface: Surface = Surface.HEDGE) -> Finish:
    return Finish(surface, float(rng.uniform(0.2, 0.65)))


def _clump(radii: Array, middle: Array, leaf: Finish, rng: np.random.Generator) -> Mesh:
    """Loose leaves in an ellipsoid (radii and middle (3,), metres), dense ones over a core."""
    count = int(np.clip(70 * radii[0] * radii[2] + 60 * radii[1] * radii[2] + 30, 40, 350))
    centres = middle + shell(count, rng, 0.55) * radii
    centres = centres[centres[:, 2] > 0.02]
    leaves = flakes(centres, rng.uniform(0.05, 0.2, len(centres)), leaf, rng)
    if rng.random() < 0.5:
        return leaves
    return merge([leaves, blob(tuple(0.6 * radii), tuple(middle), leaf, rng, 0.2)])


def shrub(rng: np.random.Generator) -> Mesh:
    """One to four clumps of leaves on the ground, wider than high or the other way round."""
    height, leaf, parts = rng.uniform(0.4, 2.6), _leaf(rng), []
    spread = height * rng.uniform(0.25, 0.9)
    for _ in range(int(rng.integers(1, 5))):
        tall = height * rng.uniform(0.5, 1.0)
        radii = np.array([*(spread * rng.uniform(0.6, 1.2, 2)), 0.55 * tall])
        middle = np.array([*(rng.uniform(-0.9, 0.9, 2) * spread), 0.48 * tall])
        parts.append(_clump(radii, middle, leaf, rng))
    return merge(parts)


def low_tree(rng: np.random.Generator) -> Mesh:
    """A tree of one or more stems whose crown begins at the ground or at one's knees."""
    height = rng.uniform(2.2, 8.0)
    start, width = rng.uniform(0.0, 0.9), height * rng.uniform(0.16, 0.4)
    bark, leaf = Finish(Surface.TRUNK, float(rng.uniform(0.15, 0.4))), _leaf(rng, Surface.LEAVES)
    parts = []
    for _ in range(int(rng.choice([1, 1, 2, 3]))):
        lean = rng.normal(0, 0.12, 2) * height
        parts.append(rod((0, 0, -0.1), (*lean, 0.8 * height), rng.uniform(0.03, 0.12), bark))
    for _ in range(int(rng.integers(0, 6))):
        low, angle = rng.uniform(0.3, 1.6), rng.uniform(0, 2 * np.pi)
        tip = (0.9 * width * np.cos(angle), 0.9 * width * np.sin(angle), low + rng.uniform(0, 0.6))
        parts.append(rod((0, 0, low), tip, 0.025, bark))
    share = rng.uniform(0, 1, int(rng.uniform(350, 800)))
    belly = np.sin(np.pi * np.clip(share, 0.02, 1.0) ** rng.uniform(0.5, 1.0)) ** 0.6
    bearing = rng.uniform(0, 2 * np.pi, len(share))
    out = width * belly * rng.uniform(0.3, 1.0, len(share)) ** 0.5
    level = start + share * (height - start) + 0.05
    centres = np.stack([out * np.cos(bearing), out * np.sin(bearing), level], axis=1)
    parts.append(flakes(centres, rng.uniform(0.07, 0.22, len(share)), leaf, rng))
    return merge(parts)


def blunt(values: Array, power: float) -> Array:
    """Sines or cosines of a circle (...) drawn towards a square's: powers from 1 down to 0."""
    return np.sign(values) * np.abs(values) ** power


def blunt_ball(rows: int, columns: int, level: float, around: float) -> Array:
    """Points (R, K, 3) from pole to pole of a body between a unit ball and a cube.

    Args:
        rows: R.
        columns: K.
        level: How blunt its profile is: 1 round, towards 0 square.
        around: The same seen from above.
    """
    polar = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rows)[:, None]
    angle = 2 * np.pi * np.arange(columns) / columns
    out = blunt(np.cos(polar), level)
    return np.stack(
        [
            out * blunt(np.cos(angle), around),
            out * blunt(np.sin(angle), around),
            np.repeat(blunt(np.sin(polar), level), columns, axis=1),
        ],
        axis=2,
    )


def clipped(rng: np.random.Generator) -> Mesh:
    """Box, yew or laurel cut to a block, a cushion or a bonnet, up to the size of a van."""
    size = np.array([rng.uniform(0.7, 5.2), rng.uniform(0.7, 2.0), rng.uniform(0.5, 2.1)])
    leaf, power = _leaf(rng), rng.uniform(0.25, 0.9)
    unit = blunt_ball(8, 16, power, power)
    rough = 1 + rng.uniform(0.01, 0.08) * rng.standard_normal((8, 16, 1))
    surface = unit * rough * 0.5 * size + np.array([0, 0, 0.5 * size[2]])
    count = int(np.clip(35 * (size[0] + size[1]) * size[2], 60, 600))
    spots = surface.reshape(-1, 3)[rng.integers(0, 128, count)]
    other = surface.reshape(-1, 3)[rng.integers(0, 128, count)]
    near = rng.uniform(0, 0.25, (count, 1))
    leaves = flakes(spots + near * (other - spots), rng.uniform(0.03, 0.12, count), leaf, rng)
    return merge([grid(surface, leaf, closed=True), leaves])


def wild_hedge(line: Array, rng: np.random.Generator) -> Mesh:
    """Shrubs grown together along ground points (K, 3): heights, widths and gaps as they come."""
    leaf, tall = _leaf(rng), float(rng.uniform(0.7, 2.6))
    parts: list[Mesh] = []
    wide = rng.uniform(0.35, 0.9)
    for point, after in pairwise(line):
        tall = float(np.clip(tall + rng.normal(0, 0.3), 0.4, 3.0))
        if rng.random() < 0.08:
            continue
        step = max(float(np.linalg.norm(after - point)), 0.5)
        radii = np.array([0.75 * step, 0.75 * step, 0.55 * tall])
        radii[:2] = np.maximum(radii[:2], wide) * rng.uniform(0.8, 1.2)
        middle = 0.5 * (point + after) + np.array([*rng.normal(0, 0.12, 2), 0.48 * tall])
        parts.append(_clump(radii, middle - [0, 0, point[2]], leaf, rng).moved((0, 0, point[2])))
    return merge(parts)


def grown_over(line: Array, rng: np.random.Generator) -> Mesh:
    """A fence or a wall along ground points (K, 3) under ivy, thin here and thick there."""
    carrier = GROWN_OVER[int(rng.integers(len(GROWN_OVER)))](line, rng)
    height = float(carrier.vertices[:, 2].max() - line[:, 2].max())
    height = max(height, 0.4) * rng.uniform(0.5, 1.2)
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    count = int(np.clip(rng.uniform(15, 50) * length * height, 30, 1500))
    at = rng.uniform(0, len(line) - 1.001, count)
    thick = rng.uniform(0.05, 0.5) * (0.4 + 0.6 * np.sin(at * rng.uniform(0.4, 1.5)) ** 2)
    centres = on_line(line, at) + np.stack(
        [*(rng.normal(0, 1, (2, count)) * thick), height * rng.uniform(0, 1, count) ** 0.8], axis=1
    )
    return merge([carrier, flakes(centres, rng.uniform(0.04, 0.15, count), _leaf(rng), rng)])


def gate(rng: np.random.Generator) -> Mesh:
    """Two gate posts with caps, at times with a wing of the gate or both; along x, open inwards."""
    gap, side, height = rng.uniform(0.9, 4.0), rng.uniform(0.2, 0.6), rng.uniform(0.8, 2.0)
    stone = Finish(Surface.WALL, float(rng.uniform(0.15, 0.6)))
    parts = []
    for end in (-0.5, 0.5):
        parts.append(box((side, side, height), (end * gap, 0, 0), stone))
        parts.append(
            box((1.25 * side, 1.25 * side, 0.12), (end * gap, 0, height), stone, (0.6, 0.6))
        )
    for end in (-0.5, 0.5):
        if rng.random() < 0.4:
            wing = box((0.45 * gap, 0.05, 0.8 * height), (-0.225 * gap * 2 * end, 0, 0.08), stone)
            parts.append(wing.moved((end * gap, 0, 0), float(rng.uniform(-1.4, 1.4))))
    return merge(parts)


def carport(rng: np.random.Generator) -> Mesh:
    """A roof on four to six posts over a car that stands along x."""
    length, width, height = rng.uniform(4.8, 6.2), rng.uniform(2.8, 3.6), rng.uniform(2.1, 2.7)
    finish = Finish(Surface.BUILDING, float(rng.uniform(0.2, 0.6)))
    parts = [box((length + 0.4, width + 0.3, 0.14), (0, 0, height), finish)]
    for x in np.linspace(-0.48, 0.48, int(rng.choice([2, 3]))) * length:
        parts += [
            box((0.11, 0.11, height), (x, y, -0.1), finish) for y in (-0.5 * width, 0.5 * width)
        ]
    if rng.random() < 0.3:
        parts.append(box((length, 0.05, 1.9), (0, 0.5 * width, 0.0), finish))
    return merge(parts)
