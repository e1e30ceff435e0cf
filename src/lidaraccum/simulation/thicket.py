"""Growth so dense that a pulse ends within a hand's breadth of its outside.

Leaves about a core, as `vegetation` and `growth` have them, scatter ranges: between neighbouring
pulses of an HDL-64E they jump by 8 cm in the median and a quarter of them by more than 30 cm, where
those of recorded vegetation jump by 4 cm and one in twenty-five by more than 30.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.growth import blunt, blunt_ball, clipped, low_tree, shrub, wild_hedge
from lidaraccum.simulation.mesh import Finish, Mesh, fan, flakes, grid, merge
from lidaraccum.simulation.surfaces import Surface
from lidaraccum.simulation.vegetation import bush, hedge, leftward, on_line

Array = NDArray[np.float64]
LOOSE: frozenset[Callable[..., Mesh]] = frozenset(
    {bush, shrub, clipped, low_tree, hedge, wild_hedge}
)
"""What may grow densely instead."""
STEP_M = 0.3
"""From one cross-section of a hedge to the next."""
WAVES = 8


@dataclass(frozen=True, eq=False)
class Thickets:
    """Grows some of a world's plants densely.

    Attributes:
        share: How many of them, 0..1.
        rng: All draws come from it, so that what is loose does not change what else is drawn.
    """

    share: float
    rng: np.random.Generator

    def body(self, maker: Callable[..., Any], loose: Mesh) -> Mesh:
        """What a maker made at the origin, or a dense body of its extents."""
        return thicket(loose.bounds, self.rng) if self._chooses(maker) else loose

    def line(self, maker: Callable[..., Any], loose: Mesh, line: Array) -> Mesh:
        """What a maker made along ground points (K, 3), or a dense hedge along them."""
        return thick_hedge(line, self.rng) if self._chooses(maker) else loose

    def _chooses(self, maker: Callable[..., Any]) -> bool:
        return maker in LOOSE and bool(self.rng.random() < self.share)


def thicket(bounds: tuple[NDArray[Any], NDArray[Any]], rng: np.random.Generator) -> Mesh:
    """One to three rounded or clipped bodies grown together that fill bounds, twigs about them.

    Args:
        bounds: (3,) least and greatest corner, metres; it stands on z = 0.
        rng: What is drawn comes from here.
    """
    low, high = (np.asarray(corner, dtype=np.float64) for corner in bounds)
    low[2] = 0.0
    size, leaf, twigs = high - low, _leaf(rng), rng.uniform(0.0, 12.0)
    count = int(rng.choice([1, 1, 2, 3]))
    parts = []
    for number in range(count):
        share = rng.uniform(0.55, 1.0, 3) if number else np.ones(3)
        radii = 0.5 * size * share
        middle = low + radii + rng.uniform(0, 1, 3) * (size - 2 * radii)
        middle[2] = 0.95 * radii[2]
        parts.append(_body(radii, middle, leaf, twigs, rng))
    return merge(parts)


def _body(
    radii: Array, middle: Array, leaf: Finish, twigs_per_m2: float, rng: np.random.Generator
) -> Mesh:
    """A closed body between an ellipsoid and a block."""
    power, bumps = rng.uniform(0.35, 1.0, 2), _bumps(rng.uniform(0.02, 0.12), rng)
    unit = blunt_ball(13, 24, *power)
    surface = middle + unit * radii
    outward = unit / np.maximum(np.linalg.norm(unit, axis=2, keepdims=True), 1e-9)
    surface += np.minimum(bumps(surface), 0.5 * radii.min())[..., None] * outward
    area = 2 * np.pi * radii[2] * (radii[0] + radii[1])
    return merge(
        [grid(surface, leaf, closed=True), _twigs(surface, twigs_per_m2 * area, leaf, rng)]
    )


def thick_hedge(line: Array, rng: np.random.Generator) -> Mesh:
    """A hedge along ground points (K, 3), clipped or grown, its outside closed."""
    long = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    at = np.linspace(0, len(line) - 1.001, max(int(long / STEP_M), 4))
    base, leaf = on_line(line, at), _leaf(rng)
    height, width = rng.uniform(0.5, 3.2), rng.uniform(0.5, 2.2)
    sway = rng.uniform(0.0, 0.25) * np.sin(rng.uniform(0, 6.28, 2) + at[:, None])
    angle, power = np.linspace(-0.15, np.pi + 0.15, 15), rng.uniform(0.25, 0.9)
    across = blunt(np.cos(angle), power)
    up = np.maximum(np.sin(angle), 0.0) ** power - 0.1 * (np.sin(angle) < 0)
    left = leftward(base)
    side = 0.5 * width * (1 + sway[:, :1]) * across
    tall = height * (1 + sway[:, 1:]) * up
    outline = base[:, None] + side[..., None] * left[:, None] + tall[..., None] * np.eye(3)[2]
    outward = across[:, None] * left[:, None] + np.maximum(up, 0.0)[:, None] * np.eye(3)[2]
    outward /= np.maximum(np.linalg.norm(outward, axis=2, keepdims=True), 1e-9)
    outline += _bumps(rng.uniform(0.01, 0.15), rng)(outline)[..., None] * outward
    twigs = rng.uniform(0.0, 12.0) * long * (2 * height + width)
    ends = [fan(outline[0], leaf), fan(outline[-1], leaf)]
    return merge([grid(outline, leaf), *ends, _twigs(outline, twigs, leaf, rng)])


def _twigs(surface: Array, count: float, leaf: Finish, rng: np.random.Generator) -> Mesh:
    """Leaves (about ``count``) that stick out of a surface (R, K, 3) by up to 20 cm."""
    spots = surface.reshape(-1, 3)
    spots = spots[rng.integers(0, len(spots), int(min(count, 2500)))]
    spots = spots + rng.normal(0, 0.1, spots.shape)
    return flakes(spots, rng.uniform(0.03, 0.12, len(spots)), leaf, rng)


def _bumps(metres: float, rng: np.random.Generator) -> Callable[[Array], Array]:
    """Waves over space, of 0.4 to 2.5 m, ``metres`` high (one sigma): places (..., 3) to (...)."""
    way = rng.standard_normal((WAVES, 3))
    way *= 2 * np.pi / rng.uniform(0.4, 2.5, (WAVES, 1)) / np.linalg.norm(way, axis=1)[:, None]
    phase = rng.uniform(0, 2 * np.pi, WAVES)
    return lambda places: metres * np.sqrt(2 / WAVES) * np.cos(places @ way.T + phase).sum(axis=-1)


def _leaf(rng: np.random.Generator) -> Finish:
    return Finish(Surface.THICKET, float(rng.uniform(0.2, 0.65)))
