"""What can move, as a shape: its meshes, its size and what it is called."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.mesh import Mesh, merge
from lidaraccum.simulation.surfaces import Surface


@dataclass(frozen=True, eq=False)
class Model:
    """A movable shape, standing on z = 0, heading along x, centred in x and y.

    Attributes:
        category: Car, Van, Truck, Bus, Tram, Motorcycle, Cyclist, Pedestrian, ...
        phases: One mesh, or one for each phase of a step.
        size_lwh: Length, width, height of its box, metres.
        stride_m: Way it goes through all its phases, metres.
    """

    category: str
    phases: tuple[Mesh, ...]
    size_lwh: tuple[float, float, float]
    stride_m: float = 1.0

    @property
    def mesh(self) -> Mesh:
        """Its first phase."""
        return self.phases[0]

    @property
    def radius_m(self) -> float:
        """Of a circle about it, seen from above."""
        return 0.5 * float(np.hypot(self.size_lwh[0], self.size_lwh[1]))

    def repainted(self, reflectivity: float) -> Model:
        """The same shape with other paint."""
        return replace(self, phases=tuple(_repaint(mesh, reflectivity) for mesh in self.phases))

    def scaled(self, scale: tuple[float, float, float]) -> Model:
        """Stretched along its axes."""
        stretched = tuple(mesh.moved((0, 0, 0), 0.0, scale) for mesh in self.phases)
        return model(self.category, stretched, self.stride_m * scale[0])


def model(category: str, phases: tuple[Mesh, ...], stride_m: float = 1.0) -> Model:
    """A model of meshes that are already on the ground; centred and measured here."""
    lows, highs = zip(*(mesh.bounds for mesh in phases), strict=True)
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    shift = -0.5 * (low + high)
    shift[2] = 0.0
    centred = tuple(mesh.with_vertices(mesh.vertices + shift) for mesh in phases)
    length, width, _ = high - low
    return Model(category, centred, (float(length), float(width), float(high[2])), stride_m)


def of_parts(category: str, *parts: Mesh) -> Model:
    """A rigid model of parts."""
    return model(category, (merge(parts),))


def _repaint(mesh: Mesh, reflectivity: float) -> Mesh:
    painted: NDArray[np.bool_] = mesh.surface == Surface.CAR_PAINT
    shade = np.where(painted, reflectivity, mesh.reflectivity).astype(np.float32)
    return replace(mesh, reflectivity=shade)
