"""One turn of the sensor: where each ray starts and goes, and what it meets first."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.actors import Actor
from lidaraccum.simulation.mesh import Mesh
from lidaraccum.simulation.raycast import RayCaster, RayScene
from lidaraccum.simulation.sensor import Sensor
from lidaraccum.simulation.surfaces import PASS_SHARE, Surface
from lidaraccum.simulation.world import World

Array = NDArray[np.float64]
Float = NDArray[np.float32]
PASSES = 3
"""A ray goes through so many see-through surfaces at most, less one."""
STEP_PAST_M = 0.01
CLEAREST_PANE = 0.45
"""Share of echoes from inside that come back through the clearest car's windows; others have less.

Without it 22 % of a simulated car's points lay more than 1.2 m behind the first, of recorded ones
8 % (HDL-64E, cars at 11 to 16 m): cars one sees through are not what a network should expect.
"""
GOLDEN = 0.6180339887
"""Multiples of it, less their whole parts, spread evenly: how clear a car's windows are."""
STRIDE = 24
"""An actor's bearing is worked out at so many columns' distance before it is culled."""


@dataclass(frozen=True, eq=False)
class Rays:
    """All rays of a turn, column by column.

    Attributes:
        times: (C,) seconds each column is fired at.
        azimuth: (C,) radians of each column in the sensor's coordinates.
        origin: (C, B, 3) float32 world.
        direction: (C, B, 3) float32 world, unit.
        local: (C, B, 3) float32 the directions the sensor reports, its own coordinates.
        world_from_sensor: (C, 4, 4) pose at each column's time.
    """

    times: Array
    azimuth: Array
    origin: Float
    direction: Float
    local: Float
    world_from_sensor: Array


@dataclass(frozen=True, eq=False)
class Encounter:
    """What the rays meet: arrays of one shape, (C, B) or flat.

    Attributes:
        distance: Float32 metres, inf for the sky.
        surface: uint8 ``Surface``.
        reflectivity: Float32 0..1.
        slant: Float32 cosine of the angle of incidence.
        instance: int32, 0 for background.
    """

    distance: Float
    surface: NDArray[np.uint8]
    reflectivity: Float
    slant: Float
    instance: NDArray[np.int32]

    def shaped(self, shape: tuple[int, int]) -> Encounter:
        """The same, column by column (C, B)."""
        return Encounter(
            self.distance.reshape(shape),
            self.surface.reshape(shape),
            self.reflectivity.reshape(shape),
            self.slant.reshape(shape),
            self.instance.reshape(shape),
        )


@dataclass(frozen=True, eq=False)
class Solid:
    """A mesh ready for rays, with what is asked of its triangles."""

    mesh: Mesh
    scene: RayScene
    normals: Float

    @classmethod
    def of(cls, mesh: Mesh, caster: RayCaster) -> Solid:
        """Make a mesh ready."""
        a, b, c = np.swapaxes(mesh.corners, 0, 1)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return cls(mesh, caster.scene(mesh), normals.astype(np.float32))


def aim(
    sensor: Sensor, times: Array, azimuth: Array, poses: Array, jitter_rad: float,
    rng: np.random.Generator,
) -> Rays:  # fmt: skip
    """The rays of a turn.

    Args:
        sensor: Its beams.
        times: (C,) seconds of each column.
        azimuth: (C,) radians of each column.
        poses: (C, 4, 4) world_from_sensor at those times.
        jitter_rad: One sigma by which a ray goes elsewhere than the sensor reports.
        rng: The frame's own.
    """
    cos, sin = np.cos(azimuth).astype(np.float32), np.sin(azimuth).astype(np.float32)
    beams = sensor.directions().astype(np.float32)
    local = np.empty((len(azimuth), len(beams), 3), dtype=np.float32)
    local[..., 0] = cos[:, None] * beams[:, 0] - sin[:, None] * beams[:, 1]
    local[..., 1] = sin[:, None] * beams[:, 0] + cos[:, None] * beams[:, 1]
    local[..., 2] = beams[:, 2]
    true = _jittered(local, sensor, jitter_rad, rng) if jitter_rad > 0 else local
    rotation = poses[:, :3, :3].astype(np.float32)
    direction = true @ np.swapaxes(rotation, 1, 2)
    raised = sensor.height.astype(np.float32)[:, None] * rotation[:, None, :, 2]
    origin = poses[:, None, :3, 3].astype(np.float32) + raised
    return Rays(times, azimuth, origin, direction, local, poses)


def _jittered(local: Float, sensor: Sensor, sigma: float, rng: np.random.Generator) -> Float:
    """Directions turned a little sideways and up; their length stays one to first order."""
    scale = np.float32(sigma * np.sqrt(12.0))
    sideways = scale * (rng.random(local.shape[:2], dtype=np.float32) - np.float32(0.5))
    upward = scale * (rng.random(local.shape[:2], dtype=np.float32) - np.float32(0.5))
    tilt = upward * np.tan(sensor.elevation).astype(np.float32)
    x, y = local[..., 0], local[..., 1]
    true = np.empty_like(local)
    true[..., 0] = x - sideways * y - tilt * x
    true[..., 1] = y + sideways * x - tilt * y
    true[..., 2] = local[..., 2] + upward * np.cos(sensor.elevation).astype(np.float32)
    return true


class Stage:
    """A world and its actors made ready for rays.

    Args:
        world: What stands.
        actors: What moves.
        caster: Casts the rays.
    """

    def __init__(self, world: World, actors: tuple[Actor, ...], caster: RayCaster) -> None:
        self.world = world
        self.actors = actors
        self._caster = caster
        self._ground = Solid.of(world.mesh, caster)
        self._solids: dict[int, Solid] = {}

    def meet(
        self, rays: Rays, sensor: Sensor, rng: np.random.Generator, reach_m: float
    ) -> Encounter:
        """What every ray of a turn ends on, see-through surfaces passed as chance has it."""
        shape = rays.origin.shape[:2]
        bundle = np.concatenate([rays.origin, rays.direction], axis=2).reshape(-1, 6)
        visits = [
            visit for actor in self.actors for visit in self._visits(actor, rays, sensor, reach_m)
        ]
        found = self._nearest(bundle, np.arange(len(bundle)), visits)
        gone = np.zeros(len(bundle), dtype=np.float32)
        for _ in range(PASSES - 1):
            share = PASS_SHARE.take(found.surface)
            open_to = np.flatnonzero((share > 0) & np.isfinite(found.distance))
            through = open_to[rng.random(len(open_to)) < share[open_to]]
            through = _not_swallowed(found, through, rng)
            if not len(through):
                break
            gone[through] = found.distance[through] + STEP_PAST_M
            onward = bundle[through].copy()
            onward[:, :3] += gone[through, None] * onward[:, 3:]
            behind = self._nearest(onward, through, visits, gone)
            for name in ("distance", "surface", "reflectivity", "slant", "instance"):
                getattr(found, name)[through] = getattr(behind, name)
            found.distance[through] += gone[through]
        assert len(found.distance) == shape[0] * shape[1]
        return found

    def _nearest(
        self, bundle: Float, numbers: NDArray[np.int64], visits: list[Visit],
        gone: Float | None = None,
    ) -> Encounter:  # fmt: skip
        """Nearest hits of rays (N, 6) with these numbers, among what stands and what visits."""
        hits = self._ground.scene.cast(bundle)
        mesh, triangle = self.world.mesh, np.maximum(hits.triangle, 0)
        missed = hits.triangle < 0
        slant = np.abs(
            np.einsum("ni,ni->n", self._ground.normals.take(triangle, axis=0), bundle[:, 3:])
        )
        found = Encounter(
            hits.distance, np.where(missed, np.uint8(0), mesh.surface.take(triangle)),
            mesh.reflectivity[triangle], slant,
            np.where(missed, np.int32(0), self.world.instance.take(triangle)),
        )  # fmt: skip
        for visit in visits:
            rows, own = _rows_of(visit.numbers, numbers, gone is None)
            if not len(rows):
                continue
            rays = visit.rays[own]
            if gone is not None:
                rays = rays.copy()
                rays[:, :3] += gone[visit.numbers[own], None] * rays[:, 3:]
            hits = visit.solid.scene.cast(rays)
            nearer = hits.distance < found.distance[rows]
            rows, triangle = rows[nearer], hits.triangle[nearer]
            found.distance[rows] = hits.distance[nearer]
            found.surface[rows] = visit.mesh.surface[triangle]
            found.reflectivity[rows] = visit.mesh.reflectivity[triangle]
            normals = visit.solid.normals[triangle]
            found.slant[rows] = np.abs(np.einsum("ni,ni->n", normals, rays[nearer, 3:]))
            found.instance[rows] = visit.instance
        return found

    def _visits(self, actor: Actor, rays: Rays, sensor: Sensor, reach_m: float) -> list[Visit]:
        """The rays that may meet an actor, in the actor's own coordinates at each ray's time."""
        height = actor.model.size_lwh[2]
        radius = 0.5 * float(np.linalg.norm(actor.model.size_lwh)) + 0.05 + 0.1 * height
        columns = self._facing(actor, rays, sensor, radius, reach_m)
        if not len(columns):
            return []
        place = actor.trajectory.place_at(rays.times[columns])
        offset = place - rays.world_from_sensor[columns, :3, 3]
        offset[:, 2] += 0.5 * height
        local = np.einsum("cij,ci->cj", rays.world_from_sensor[columns, :3, :3], offset)
        flat = np.maximum(np.hypot(local[:, 0], local[:, 1]), 1e-3)
        wide = _half_angle(radius, flat)
        bearing = np.arctan2(local[:, 1], local[:, 0]) - rays.azimuth[columns]
        up = np.arctan2(local[:, 2], flat)
        tall = _half_angle(radius, np.hypot(flat, local[:, 2]))
        found = []
        for turn, spread, members in _beam_groups(sensor):
            gap = np.abs(np.mod(bearing - turn + np.pi, 2 * np.pi) - np.pi)
            near = np.flatnonzero(gap < wide + spread + 0.005)
            if not len(near):
                continue
            low, high = (up - tall)[near].min() - 0.03, (up + tall)[near].max() + 0.03
            level = sensor.elevation[members]
            beams = members[(level > low) & (level < high)]
            if len(beams):
                found.append(self._visit(actor, rays, columns[near], beams))
        return found

    def _facing(
        self, actor: Actor, rays: Rays, sensor: Sensor, radius: float, reach_m: float
    ) -> NDArray[np.int64]:
        """Columns that may meet an actor, from its bearing at every ``STRIDE`` columns."""
        some = np.arange(0, len(rays.times) + STRIDE, STRIDE).clip(max=len(rays.times) - 1)
        offset = actor.trajectory.place_at(rays.times[some]) - rays.world_from_sensor[some, :3, 3]
        distance = np.linalg.norm(offset, axis=1)
        if distance.min() > reach_m + radius:
            return np.zeros(0, dtype=np.int64)
        local = np.einsum("cij,ci->cj", rays.world_from_sensor[some, :3, :3], offset)
        wide = _half_angle(radius, np.maximum(np.hypot(local[:, 0], local[:, 1]), 1e-3))
        bearing = np.arctan2(local[:, 1], local[:, 0]) - rays.azimuth[some]
        step = 2 * np.pi * STRIDE / len(rays.times)
        facing = np.zeros(len(some), dtype=np.bool_)
        for turn, spread, _ in _beam_groups(sensor):
            gap = np.abs(np.mod(bearing - turn + np.pi, 2 * np.pi) - np.pi)
            facing |= gap < wide + spread + 1.5 * step
        spread_out = some[facing][:, None] + np.arange(-STRIDE, STRIDE + 1)
        return np.unique(spread_out.clip(0, len(rays.times) - 1))

    def _visit(
        self, actor: Actor, rays: Rays, columns: NDArray[np.int64], beams: NDArray[np.int64]
    ) -> Visit:  # fmt: skip
        mesh = actor.mesh_at(float(rays.times[columns[len(columns) // 2]]))
        solid = self._solids.get(id(mesh.vertices))
        if solid is None:
            solid = self._solids.setdefault(id(mesh.vertices), Solid.of(mesh, self._caster))
        poses = actor.trajectory.poses_at(rays.times[columns])
        rotation = poses[:, :3, :3].astype(np.float32)
        pick = np.ix_(columns, beams)
        place = poses[:, None, :3, 3].astype(np.float32)
        origin = (rays.origin[pick] - place) @ rotation
        direction = rays.direction[pick] @ rotation
        numbers = (columns[:, None] * rays.origin.shape[1] + beams).ravel()
        own = np.concatenate([origin, direction], axis=2).reshape(-1, 6)
        return Visit(actor.id, mesh, solid, numbers, own)


@dataclass(frozen=True, eq=False)
class Visit:
    """Rays that may meet an actor.

    Attributes:
        instance: The actor's id.
        mesh: Its mesh, with its own paint.
        solid: That mesh ready for rays (shared between paints).
        numbers: (N,) which rays.
        rays: (N, 6) float32 in the actor's coordinates.
    """

    instance: int
    mesh: Mesh
    solid: Solid
    numbers: NDArray[np.int64]
    rays: Float


def _not_swallowed(
    found: Encounter, through: NDArray[np.int64], rng: np.random.Generator
) -> NDArray[np.int64]:
    """Rays (K,) that go on; the others are swallowed inside a car, whose ``found`` is blanked.

    An echo from inside has to come back through the pane too, and panes are tinted, car by car.
    """
    clear = CLEAREST_PANE * np.modf(found.instance[through] * GOLDEN)[0]
    dark = (found.surface[through] == Surface.CAR_GLASS) & (rng.random(len(through)) > clear)
    found.distance[through[dark]] = np.inf
    return through[~dark]


def _rows_of(
    visiting: NDArray[np.int64], numbers: NDArray[np.int64], everyone: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of ``numbers`` (sorted) that are visiting, and their rows among the visiting."""
    if everyone:
        return visiting, np.arange(len(visiting))
    rows = np.searchsorted(numbers, visiting)
    rows = np.minimum(rows, len(numbers) - 1)
    own = np.flatnonzero(numbers[rows] == visiting)
    return rows[own], own


def _half_angle(radius: float, distance: Array) -> Array:
    """Radians (C,) under which half of a ball is seen; all round from within."""
    angle = np.arcsin(np.minimum(radius / np.maximum(distance, 1e-3), 1.0))
    return np.where(distance > radius, angle, np.pi)


@lru_cache(maxsize=16)
def _beam_groups(sensor: Sensor) -> list[tuple[float, float, NDArray[np.int64]]]:
    """Beams of about the same azimuth: their middle, half their spread, their rows."""
    key = np.round(sensor.azimuth / np.deg2rad(3.0)).astype(int)
    groups = []
    for value in np.unique(key):
        members = np.flatnonzero(key == value)
        middle = 0.5 * (sensor.azimuth[members].min() + sensor.azimuth[members].max())
        spread = 0.5 * float(np.ptp(sensor.azimuth[members]))
        groups.append((float(middle), spread, members))
    return groups
