"""What things are made of: the class of a surface and how a laser pulse fares on it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class Surface(IntEnum):
    """Kind of surface of one triangle; also the ``semantic`` class of a simulated point."""

    NONE = 0
    ROAD = 1
    SIDEWALK = 2
    GRASS = 3
    GRAVEL = 4
    BUILDING = 5
    WALL = 6
    GLASS = 7
    FENCE = 8
    MESH_FENCE = 9
    HEDGE = 10
    LEAVES = 11
    TRUNK = 12
    POLE = 13
    SIGN = 14
    FURNITURE = 15
    CAR_PAINT = 16
    CAR_GLASS = 17
    TYRE = 18
    TRIM = 19
    INTERIOR = 20
    CLOTH = 21
    SKIN = 22
    CYCLE = 23
    CARGO = 24
    OWN_CAR = 25
    CLUTTER = 26
    THICKET = 27


SURFACE_COUNT = len(Surface)


def _table(default: float, special: dict[Surface, float]) -> NDArray[np.float32]:
    values = np.full(SURFACE_COUNT, default, dtype=np.float32)
    for surface, value in special.items():
        values[surface] = value
    return values


PASS_SHARE = _table(
    0.0,
    {
        Surface.GLASS: 0.45,
        Surface.CAR_GLASS: 0.6,
        Surface.MESH_FENCE: 0.72,
        Surface.LEAVES: 0.12,
        Surface.HEDGE: 0.12,
        Surface.THICKET: 0.03,
    },
)
"""Share of the pulses that go on through the surface and hit what is behind it."""

LOSS_SHARE = _table(
    0.0,
    {Surface.GLASS: 0.4, Surface.CAR_GLASS: 0.4, Surface.CAR_PAINT: 0.02, Surface.TRIM: 0.1},
)
"""Share of the pulses thrown elsewhere as by a mirror, never to come back."""

ROUGHNESS_M = _table(
    0.004,
    {
        Surface.ROAD: 0.004,
        Surface.SIDEWALK: 0.006,
        Surface.GRASS: 0.025,
        Surface.GRAVEL: 0.02,
        Surface.HEDGE: 0.04,
        Surface.THICKET: 0.04,
        Surface.LEAVES: 0.02,
        Surface.TRUNK: 0.015,
        Surface.CLOTH: 0.01,
        Surface.CARGO: 0.01,
    },
)
"""Scatter of the surface about its triangles, metres (one sigma, along the ray)."""

WETTABLE = _table(0.0, {Surface.ROAD: 1.0, Surface.SIDEWALK: 1.0, Surface.GRAVEL: 1.0}) > 0
"""Ground that turns into a mirror when it is wet."""
