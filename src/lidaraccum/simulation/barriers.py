"""What lines a property or a road: fences of all kinds, walls, rails; thin, porous or solid."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Finish, Mesh, box, extrude, grid, merge, quads, rod
from lidaraccum.simulation.surfaces import Surface
from lidaraccum.simulation.vegetation import hedge

Array = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


def _posts(line: Array, every: int, height: float, radius: float, finish: Finish) -> list[Mesh]:
    return [rod(point, point + height * UP, radius, finish) for point in line[::every]]


def _band(line: Array, low: float, high: float, finish: Finish) -> Mesh:
    """An upright sheet along the line between two heights above it."""
    return grid(np.stack([line + low * UP, line + high * UP]), finish)


def _solid(line: Array, height: float, thickness: float, finish: Finish) -> Mesh:
    """A wall with both faces, its top and its ends."""
    ahead = np.gradient(line[:, :2], axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    left = 0.5 * thickness * np.stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(line))], axis=1)
    top, foot = height * UP, -0.1 * UP
    ring = np.stack([line + left + foot, line + left + top, line - left + top, line - left + foot])
    ends = np.stack([ring[:, 0], ring[:, -1]])
    return merge([grid(ring, finish), quads(ends, finish)])


def pickets(line: Array, rng: np.random.Generator) -> Mesh:
    """Upright slats with gaps on two rails."""
    height, finish = rng.uniform(0.7, 1.9), Finish(Surface.FENCE, float(rng.uniform(0.2, 0.8)))
    slat, gap = rng.uniform(0.03, 0.14), rng.uniform(0.03, 0.14)
    arc = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    start = np.arange(0, arc[-1] - slat, slat + gap)
    foot, head = (
        np.stack([np.interp(at, arc, line[:, axis]) for axis in range(3)], axis=1)
        for at in (start, start + slat)
    )
    low, high = 0.05 * UP, height * UP
    slats = quads(np.stack([foot + low, head + low, head + high, foot + high], axis=1), finish)
    rails = [_band(line, share * height, share * height + 0.07, finish) for share in (0.2, 0.8)]
    return merge([slats, *rails, *_posts(line, 2, height, 0.05, finish)])


def boards(line: Array, rng: np.random.Generator) -> Mesh:
    """A closed fence of boards between posts."""
    height, finish = rng.uniform(1.2, 2.2), Finish(Surface.FENCE, float(rng.uniform(0.2, 0.6)))
    return merge([_band(line, 0.03, height, finish), *_posts(line, 2, height + 0.1, 0.06, finish)])


def wire_mesh(line: Array, rng: np.random.Generator) -> Mesh:
    """Chain link between posts: most pulses go through."""
    height, finish = rng.uniform(0.9, 2.5), Finish(Surface.MESH_FENCE, float(rng.uniform(0.2, 0.5)))
    steel = Finish(Surface.FENCE, 0.4)
    return merge([_band(line, 0.03, height, finish), *_posts(line, 2, height, 0.03, steel)])


def railing(line: Array, rng: np.random.Generator) -> Mesh:
    """Two to four thin rails on posts."""
    height, finish = rng.uniform(0.8, 1.2), Finish(Surface.FENCE, float(rng.uniform(0.2, 0.7)))
    rails = np.linspace(0.35, 1.0, int(rng.integers(2, 5))) * height
    bands = [_band(line, z - 0.05, z, finish) for z in rails]
    return merge([*bands, *_posts(line, int(rng.integers(1, 4)), height, 0.03, finish)])


def guard_rail(line: Array, rng: np.random.Generator) -> Mesh:
    """A crash barrier's beam on posts."""
    finish = Finish(Surface.FENCE, float(rng.uniform(0.4, 0.7)))
    return merge([_band(line, 0.45, 0.76, finish), *_posts(line, 2, 0.75, 0.06, finish)])


def wall(line: Array, rng: np.random.Generator) -> Mesh:
    """A wall, from knee height to above one's head, at times with a fence on it."""
    height, finish = rng.uniform(0.3, 2.4), Finish(Surface.WALL, float(rng.uniform(0.15, 0.6)))
    solid = _solid(line, height, rng.uniform(0.12, 0.45), finish)
    if height < 1.1 and rng.random() < 0.4:
        return merge([solid, pickets(line + height * UP, rng)])
    return solid


def concrete_blocks(line: Array, rng: np.random.Generator) -> Mesh:
    """Jersey barriers or stone blocks in a row with gaps."""
    finish, parts = Finish(Surface.WALL, float(rng.uniform(0.3, 0.6))), []
    size = (rng.uniform(0.6, 1.8), rng.uniform(0.4, 0.7), rng.uniform(0.4, 0.95))
    for start, end in zip(line[:-2:2], line[2::2], strict=False):
        ahead = end - start
        block = box(size, (0, 0, 0), finish, (1.0, float(rng.uniform(0.4, 1.0))))
        parts.append(block.moved(tuple(start), float(np.arctan2(ahead[1], ahead[0]))))
    return merge(parts)


def noise_wall(line: Array, rng: np.random.Generator) -> Mesh:
    """A tall screen beside a fast road."""
    finish = Finish(Surface.WALL, float(rng.uniform(0.2, 0.5)))
    height = rng.uniform(2.5, 4.5)
    return merge([_solid(line, height, 0.2, finish), *_posts(line, 4, height + 0.1, 0.12, finish)])


def earth_bank(line: Array, rng: np.random.Generator) -> Mesh:
    """A low bank of earth, as long as one likes, grown over."""
    finish = Finish(Surface.GRASS, float(rng.uniform(0.2, 0.5)))
    height, width = rng.uniform(0.4, 1.8), rng.uniform(1.2, 3.0)
    ahead = np.gradient(line[:, :2], axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    left = np.stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(line))], axis=1)
    side = np.array([-0.5, -0.3, -0.1, 0.1, 0.3, 0.5]) * width
    tall = np.array([-0.1, 0.55, 1.0, 1.0, 0.55, -0.1]) * height
    taper = np.minimum(1.0, np.minimum(np.arange(len(line)), np.arange(len(line))[::-1]) / 2.0)
    rough = 1 + 0.12 * rng.standard_normal((len(line), 6))
    ring = line[:, None] + side[:, None] * left[:, None]
    ring = ring + (taper[:, None] * tall * rough)[..., None] * UP
    return grid(ring, finish)


def stairs(rng: np.random.Generator) -> Mesh:
    """Steps up to a door or a terrace, with their cheeks."""
    count, width = int(rng.integers(2, 9)), rng.uniform(1.0, 3.5)
    rise, tread = 0.17, 0.29
    outline = [(0.0, 0.0)]
    for step in range(count):
        outline += [(step * tread, (step + 1) * rise), ((step + 1) * tread, (step + 1) * rise)]
    outline.append((count * tread, 0.0))
    return extrude(np.array(outline), width, Finish(Surface.WALL, float(rng.uniform(0.2, 0.5))))


BARRIERS: dict[str, Callable[[Array, np.random.Generator], Mesh]] = {
    "hedge": hedge, "wall": wall, "pickets": pickets, "boards": boards, "wire_mesh": wire_mesh,
    "railing": railing, "guard_rail": guard_rail, "blocks": concrete_blocks, "bank": earth_bank,
    "noise_wall": noise_wall,
}  # fmt: skip
"""Barriers by name: each runs along ground points (K, 3)."""
