"""Trees one sees through, bushes and hedges with leaves over a bumpy core, grass and reeds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Finish, Mesh, blob, fan, flakes, grid, lathe, merge, rod
from lidaraccum.simulation.surfaces import Surface

Array = NDArray[np.float64]


def _leaf(rng: np.random.Generator, surface: Surface = Surface.LEAVES) -> Finish:
    return Finish(surface, float(rng.uniform(0.25, 0.65)))


def shell(count: int, rng: np.random.Generator, inner: float) -> Array:
    """Points (N, 3) in a unit ball, outside its ``inner`` share."""
    direction = rng.standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return direction * rng.uniform(inner**3, 1.0, (count, 1)) ** (1 / 3)


def on_line(line: Array, at: Array) -> Array:
    """Points (N, 3) at places (N,) on a line (K, 3), counted in its points, below K - 1."""
    low, share = at.astype(int), (at - at.astype(int))[:, None]
    return line[low] * (1 - share) + line[low + 1] * share


def leftward(line: Array) -> Array:
    """Unit vectors (K, 3), level, to the left of a line (K, 3)."""
    ahead = np.gradient(line[:, :2], axis=0)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    return np.stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(line))], axis=1)


def broadleaf(rng: np.random.Generator) -> Mesh:
    """A tree whose crown is several clumps of loose leaves on branches."""
    height = rng.uniform(4.5, 14.0)
    bole = rng.uniform(0.7, 0.3 * height + 0.8)
    width = rng.uniform(0.25, 0.42) * height
    bark = Finish(Surface.TRUNK, float(rng.uniform(0.15, 0.4)))
    radius = rng.uniform(0.08, 0.03 * height + 0.05)
    parts = [lathe([(1.4 * radius, -0.2), (radius, 0.4), (0.6 * radius, 0.7 * height)], bark, 8)]
    clumps = int(rng.integers(4, 9))
    leaves = int(rng.uniform(600, 1200))
    leaf, size = _leaf(rng), rng.uniform(0.12, 0.24)
    for _ in range(clumps):
        angle, out = rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 0.65) * width
        middle = np.array(
            [out * np.cos(angle), out * np.sin(angle), rng.uniform(bole + 0.4, 0.85 * height)]
        )
        radii = np.array([0.55, 0.55, 0.5]) * width * rng.uniform(0.6, 1.1)
        centres = middle + shell(leaves // clumps, rng, 0.3) * radii
        centres = centres[centres[:, 2] > bole * 0.8]
        parts.append(flakes(centres, rng.uniform(0.6, 1.4, len(centres)) * size, leaf, rng))
        parts.append(rod((0, 0, bole), middle, 0.4 * radius, bark))
    return merge(parts)


def conifer(rng: np.random.Generator) -> Mesh:
    """A cone of loose needles about a straight trunk."""
    height, radius = rng.uniform(3.0, 14.0), rng.uniform(0.16, 0.28)
    bark, leaf = Finish(Surface.TRUNK, 0.25), _leaf(rng)
    share = rng.uniform(0.08, 1.0, int(rng.uniform(500, 900))) ** 0.6
    angle = rng.uniform(0, 2 * np.pi, len(share))
    out = radius * height * share * rng.uniform(0.45, 1.0, len(share))
    low = rng.uniform(0.2, 1.5)
    centres = np.stack(
        [out * np.cos(angle), out * np.sin(angle), low + (1 - share) * (height - low)], axis=1
    )
    trunk = lathe([(0.018 * height + 0.04, -0.2), (0.02, height)], bark, 7)
    return merge([trunk, flakes(centres, rng.uniform(0.12, 0.35, len(share)), leaf, rng)])


def young_tree(rng: np.random.Generator) -> Mesh:
    """A slim street tree with its stakes."""
    bark = Finish(Surface.TRUNK, 0.3)
    height = rng.uniform(2.5, 5.0)
    parts = [rod((0, 0, -0.1), (0, 0, 0.8 * height), rng.uniform(0.03, 0.07), bark)]
    parts += [
        rod((x, y, 0), (x, y, 1.6), 0.035, bark)
        for x, y in ((0.4, 0.0), (-0.4, 0.0), (0.0, 0.4))[: rng.integers(0, 4)]
    ]
    middle = np.array([0, 0, 0.72 * height])
    centres = middle + shell(220, rng, 0.1) * np.array([0.9, 0.9, 0.3 * height])
    parts.append(flakes(centres, rng.uniform(0.08, 0.2, 220), _leaf(rng), rng))
    return merge(parts)


def bare_tree(rng: np.random.Generator) -> Mesh:
    """A tree in winter: trunk, branches, twigs."""
    height, bark = rng.uniform(4, 12), Finish(Surface.TRUNK, float(rng.uniform(0.15, 0.4)))
    radius = 0.015 * height + 0.05
    parts = [lathe([(1.3 * radius, -0.2), (radius, 1.0), (0.03, height)], bark, 7)]
    for _ in range(int(rng.integers(8, 16))):
        start = np.array([0, 0, rng.uniform(0.25, 0.85) * height])
        angle, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0.15, 0.35) * height
        end = start + reach * np.array([np.cos(angle), np.sin(angle), rng.uniform(0.3, 1.2)])
        parts.append(rod(start, end, 0.3 * radius, bark))
        for _ in range(3):
            fork = start + rng.uniform(0.4, 0.9) * (end - start)
            parts.append(rod(fork, fork + 0.4 * reach * rng.uniform(-1, 1, 3), 0.02, bark))
    return merge(parts)


def draw_tree(rng: np.random.Generator) -> Mesh:
    """Any tree."""
    kinds = (broadleaf, conifer, young_tree, bare_tree)
    return kinds[int(rng.choice(4, p=[0.5, 0.2, 0.2, 0.1]))](rng)


def bush(rng: np.random.Generator, height: float | None = None) -> Mesh:
    """A round bush, or a few grown together, of any size up to a car's."""
    height = height or float(rng.uniform(0.4, 3.2))
    leaf, parts = _leaf(rng, Surface.HEDGE), []
    for _ in range(int(rng.integers(1, 5))):
        tall = height * rng.uniform(0.6, 1.0)
        radii = np.array([*(tall * rng.uniform(0.4, 0.9, 2)), 0.5 * tall])
        shift = np.array([*(rng.uniform(-0.7, 0.7, 2) * height), 0.5 * tall])
        core = blob(tuple(0.72 * radii), tuple(shift), leaf, rng, 0.12)
        centres = shift + shell(int(50 + 80 * tall), rng, 0.75) * radii
        parts += [core, flakes(centres, rng.uniform(0.05, 0.2, len(centres)), leaf, rng)]
    return merge(parts)


def tufts(rng: np.random.Generator) -> Mesh:
    """A patch of high grass, reeds or ivy: loose blades a metre or two across."""
    count = int(rng.integers(30, 120))
    reach, height = rng.uniform(0.5, 2.0), rng.uniform(0.15, 1.0)
    places = rng.normal(0, 0.5 * reach, (count, 2))
    centres = np.concatenate([places, rng.uniform(0, height, (count, 1))], axis=1)
    return flakes(centres, rng.uniform(0.04, 0.15, count), _leaf(rng, Surface.GRASS), rng)


def hedge(line: Array, rng: np.random.Generator) -> Mesh:
    """A hedge along ground points (K, 3), about a metre apart: bumpy core, leaves about it."""
    height, width = rng.uniform(0.6, 3.2), rng.uniform(0.5, 1.8)
    neat, leaf = rng.uniform(0.02, 0.18), _leaf(rng, Surface.HEDGE)
    left = leftward(line)
    outline = np.array(
        [[-0.5, -0.05], [-0.5, 0.5], [-0.45, 0.9], [0, 1.0], [0.45, 0.9], [0.5, 0.5], [0.5, -0.05]]
    )
    swell = 1 + neat * rng.standard_normal((len(line), 7))
    side = 0.8 * outline[:, 0] * width * swell
    tall = 0.92 * outline[:, 1] * height * (1 + 0.5 * neat * rng.standard_normal((len(line), 7)))
    ring = line[:, None] + side[..., None] * left[:, None] + tall[..., None] * np.eye(3)[2]
    length = float(np.linalg.norm(line[-1] - line[0]))
    count = int(min(45 * length * (height + 0.5 * width), 5000))
    at = rng.uniform(0, len(line) - 1.001, count)
    base = on_line(line, at)
    pick = rng.uniform(0, 6, count)
    first, part = pick.astype(int), pick - pick.astype(int)
    spot = outline[first] * (1 - part)[:, None] + outline[first + 1] * part[:, None]
    out = 1 + neat * rng.standard_normal((count, 2))
    centres = base + (spot[:, :1] * width * out[:, :1]) * left[at.astype(int)]
    centres[:, 2] += spot[:, 1] * height * out[:, 1]
    ends = [fan(ring[0], leaf), fan(ring[-1], leaf)]
    return merge(
        [grid(ring, leaf), *ends, flakes(centres, rng.uniform(0.05, 0.16, count), leaf, rng)]
    )
