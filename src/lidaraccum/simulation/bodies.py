"""Car bodies lofted from a side outline: bonnet, windscreen, roof, windows, arches, wheels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Finish, Mesh, box, disc_wheel, fan, grid, merge
from lidaraccum.simulation.surfaces import Surface

Array = NDArray[np.float64]
TYRE = Finish(Surface.TYRE, 0.06)
INSIDE = Finish(Surface.INTERIOR, 0.12)
TRIM = Finish(Surface.TRIM, 0.1)


@dataclass(frozen=True)
class BodyShape:
    """A body's outline from the side and across.

    Attributes:
        outline: Points (x, z) of the top from nose to tail, metres; x falls.
        belt: Points (x, z) of the line under the windows, from nose to tail.
        width: Metres at the belt.
        taper: Width of the roof against that of the belt.
        clearance: Height of the sill, metres.
        wheels: x of each axle.
        wheel_radius: Metres.
        pillars: x of what stands between the side windows.
        rounding: How much narrower nose and tail are.
        paint: Reflectivity of the body.
        side_glass: Foremost and rearmost x of the side windows.
    """

    outline: tuple[tuple[float, float], ...]
    belt: tuple[tuple[float, float], ...]
    width: float
    taper: float
    clearance: float
    wheels: tuple[float, ...]
    wheel_radius: float
    pillars: tuple[float, ...]
    rounding: float
    paint: float
    side_glass: tuple[float, float]


def body(shape: BodyShape) -> Mesh:
    """The shell with its windows, closed at both ends and below."""
    stations = _stations(shape)
    top = _along(shape.outline, stations)
    belt = np.minimum(_along(shape.belt, stations), top - 0.02)
    nose, tail = stations[0], stations[-1]
    middle, reach = 0.5 * (nose + tail), 0.5 * (nose - tail)
    squeeze = 1 - shape.rounding * np.abs((stations - middle) / reach) ** 4
    half = 0.5 * shape.width * squeeze
    sill = shape.clearance + 0.12 * np.abs((stations - middle) / reach) ** 6
    arch = _arches(shape, stations, sill)
    glazed = np.clip((top - belt) / 0.4, 0, 1)
    roof = half * (1 - (1 - shape.taper) * glazed)
    zero = np.zeros_like(half)
    y = np.stack([zero, 0.8 * half, half * 0.97, half, half * 0.98, roof, roof * 0.75, zero], 1)
    upper = top - 0.05 * np.clip((top - belt) / 0.1, 0, 1)
    shoulder = np.maximum(0.55 * belt + 0.45 * sill, arch + 0.02)
    z = np.stack([sill, sill, arch, shoulder, belt, upper, top, top], 1)
    ring = np.stack(
        [
            np.concatenate([y, -y[:, -2:0:-1]], axis=1),
            np.concatenate([z, z[:, -2:0:-1]], axis=1),
        ],
        axis=2,
    )
    along = np.broadcast_to(stations[:, None, None], (*ring.shape[:2], 1))
    rings = np.concatenate([along, ring], axis=2)
    paint = Finish(Surface.CAR_PAINT, shape.paint)
    shell = grid(rings, paint, closed=True)
    shell = _glaze(shell, rings.shape[:2], _windows(shape, stations, top, belt))
    return merge([shell, fan(rings[0], paint), fan(rings[-1], paint)])


def _stations(shape: BodyShape) -> Array:
    """Where sections are taken, from nose to tail."""
    corners = [x for x, _ in shape.outline]
    pillars = [x + side for x in shape.pillars for side in (-0.05, 0.05)]
    arches = [
        x + reach * shape.wheel_radius
        for x in shape.wheels
        for reach in (-1.15, -0.7, 0, 0.7, 1.15)
    ]
    fill = list(np.linspace(corners[0], corners[-1], 9))
    inside = np.clip(
        [*corners, *pillars, *arches, *fill, *shape.side_glass], corners[-1], corners[0]
    )
    return np.unique(np.round(inside, 2))[::-1]


def _along(line: tuple[tuple[float, float], ...], stations: Array) -> Array:
    x, z = np.asarray(line, dtype=np.float64)[::-1].T
    return np.interp(stations, x, z)


def _arches(shape: BodyShape, stations: Array, sill: Array) -> Array:
    arch = sill + 0.08
    radius = 1.12 * shape.wheel_radius
    for axle in shape.wheels:
        rise = np.sqrt(np.clip(radius**2 - (stations - axle) ** 2, 0, None))
        arch = np.maximum(arch, np.where(rise > 0, shape.wheel_radius + rise, 0))
    return arch


def _windows(shape: BodyShape, stations: Array, top: Array, belt: Array) -> NDArray[np.bool_]:
    """(S-1, 14) bool: which quads of the shell are glass."""
    middle = 0.5 * (stations[1:] + stations[:-1])
    height = 0.5 * ((top - belt)[1:] + (top - belt)[:-1])
    slope = np.abs(np.diff(top) / np.minimum(np.diff(stations), -1e-3))
    front, rear = shape.side_glass
    side = (height > 0.15) & (middle < front) & (middle > rear)
    for pillar in shape.pillars:
        side &= np.abs(middle - pillar) > 0.05
    highest = float(top.max())
    screen = (slope > 0.25) & (height > 0.02) & (top[1:] + top[:-1] > 1.25 * highest)
    glass = np.zeros((len(middle), 14), dtype=np.bool_)
    glass[:, [4, 9]] = side[:, None]
    glass[:, [6, 7]] = screen[:, None]
    return glass


def _glaze(shell: Mesh, shape: tuple[int, int], glass: NDArray[np.bool_]) -> Mesh:
    flat = np.tile(glass.reshape(-1), 2)
    assert len(flat) == len(shell) == 2 * (shape[0] - 1) * shape[1]
    return Mesh(
        shell.vertices,
        shell.triangles,
        np.where(flat, np.uint8(Surface.CAR_GLASS), shell.surface).astype(np.uint8),
        np.where(flat, np.float32(0.1), shell.reflectivity).astype(np.float32),
    )


def wheels(shape: BodyShape, tyre_width: float = 0.22) -> Mesh:
    """A wheel at both ends of each axle."""
    out = 0.5 * shape.width - 0.5 * tyre_width - 0.02
    radius = shape.wheel_radius
    return merge(
        disc_wheel((axle, side * out, radius), radius, tyre_width, TYRE)
        for axle in shape.wheels
        for side in (-1, 1)
    )


def mirrors(x: float, width: float, z: float) -> Mesh:
    """Outside mirrors."""
    return merge(
        box((0.1, 0.2, 0.14), (x, side * (0.5 * width + 0.08), z), TRIM) for side in (-1, 1)
    )


def seats(rows: tuple[float, ...], width: float, floor: float) -> Mesh:
    """Two seats with backs in each row, at x."""
    parts = []
    for x in rows:
        for side in (-1, 1):
            y = side * 0.22 * width
            parts.append(box((0.5, 0.3 * width, 0.18), (x, y, floor), INSIDE))
            parts.append(box((0.14, 0.28 * width, 0.72), (x - 0.28, y, floor), INSIDE))
    return merge(parts)
