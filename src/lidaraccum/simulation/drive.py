"""A simulated drive: a labelled sequence like any other, cast frame by frame when asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame, Labels
from lidaraccum.geometry.rigid import invert
from lidaraccum.simulation.actors import Actor
from lidaraccum.simulation.ego import Ego, draw_body, draw_mount, drive_ego
from lidaraccum.simulation.labelling import Movables, Seen, label
from lidaraccum.simulation.motion import sample_times, speed_profile
from lidaraccum.simulation.networks import lay_network
from lidaraccum.simulation.raycast import RayCaster, usual_caster
from lidaraccum.simulation.returns import Echoes, draw_bias, measure
from lidaraccum.simulation.scan import Encounter, Rays, Solid, Stage, aim
from lidaraccum.simulation.settings import DriveSettings, child, draw_drive
from lidaraccum.simulation.surfaces import Surface
from lidaraccum.simulation.sweep_truth import Sweep
from lidaraccum.simulation.traffic import Traffic
from lidaraccum.simulation.world import Filling, World, build_world

__all__ = ["DriveSettings", "SimulatedSequence", "simulate"]

Array = NDArray[np.float64]
JITTER_RAD = 0.0006
"""One sigma of where a ray goes against where the sensor says it went."""
BOX_MARGIN_M = 20.0
"""Boxes are listed this far beyond the sensor's reach."""


class SimulatedSequence:
    """Frames of a simulated drive, with the truth. See ``simulate``."""

    def __init__(self, settings: DriveSettings, caster: RayCaster) -> None:
        self.settings = settings
        self.drawn = draw_drive(settings)
        self._caster = caster
        self._period = 1.0 / self.drawn.rate_hz
        duration = settings.frames * self._period
        rng = np.random.default_rng([settings.seed, 2])
        reach = (self.drawn.speed_mps + 2.0) * duration
        network = lay_network(self.drawn.scene, reach, child(rng))
        filling = Filling(
            settings.rare, settings.green, settings.dense, settings.beside, settings.furniture
        )
        self.world: World = build_world(network, reach, child(rng), filling)
        self.ego = self._drive(duration, child(rng))
        self.actors: tuple[Actor, ...] = Traffic(self.world, self.ego, child(rng)).populate()
        self.movables = Movables(self.world.stills, self.actors)
        self._bias = self.drawn.beam_bias * draw_bias(self.drawn.sensor, child(rng))
        self._stage = Stage(self.world, self.actors, caster)
        self._start_azimuth = float(child(rng).choice([np.pi, np.pi, 0.0, 0.5 * np.pi]))
        self._own: NDArray[np.float32] = self._see_own_car()
        self._last: tuple[int, Frame, Labels] | None = None

    # -- the protocol --

    @property
    def name(self) -> str:
        """Scene, sensor and seed."""
        return f"simulated-{self.drawn.scene}-{self.drawn.sensor.name}-{self.settings.seed}"

    @property
    def sensor(self) -> str:
        """The sensor's name."""
        return self.drawn.sensor.name

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return self.drawn.rate_hz

    @property
    def poses(self) -> Array | None:
        """None: a simulated drive comes without poses; the truth is in the labels."""
        return None

    @property
    def crs_wkt(self) -> str | None:
        """None: the world lies nowhere."""
        return None

    def __len__(self) -> int:
        return self.settings.frames

    def __getitem__(self, index: int) -> Frame:
        return self._frame(index)[0]

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def labels(self, index: int) -> Labels:
        """The truth about frame ``index``, row by row with its points."""
        return self._frame(index)[1]

    # -- casting --

    def stamp(self, index: int) -> float:
        """Reference time of a frame, seconds: the middle of its sweep."""
        return index * self._period

    def world_from_sensor(self, times: Array) -> Array:
        """(M, 4, 4) poses of the frames' coordinates at times (M,): sensor's or vehicle's."""
        poses = self.ego.trajectory.poses_at(times)
        return poses if self.drawn.vehicle_coordinates else poses @ self.ego.vehicle_from_sensor

    def _drive(self, duration: float, rng: np.random.Generator) -> Ego:
        times, network = sample_times(duration), self.world.network
        speed = min(self.drawn.speed_mps, network.ego_speed_limit)
        speeds = speed_profile(times, speed, self.drawn.manoeuvre, rng, network.ego_speed_limit)
        trajectory = drive_ego(
            network.ego, network.ego_start, speeds, duration, self.world.terrain, rng
        )
        mount = draw_mount(rng)
        body = draw_body(mount, rng)
        return Ego(trajectory, mount, speeds, body, bool(rng.random() < 0.5))

    def _see_own_car(self) -> NDArray[np.float32]:
        """(C, B) distance to the own car's body, the same in every turn; inf where it is not."""
        sensor = self.drawn.sensor
        columns = sensor.columns_at(self.drawn.rate_hz)
        if not len(self.ego.body):
            return np.full((columns, sensor.beams), np.inf, dtype=np.float32)
        poses = np.repeat(self.ego.vehicle_from_sensor[None], columns, axis=0)
        rng = np.random.default_rng(0)
        rays = aim(sensor, np.zeros(columns), self._azimuth(), poses, 0.0, rng)
        bundle = np.concatenate([rays.origin, rays.direction], axis=2).reshape(-1, 6)
        hits = Solid.of(self.ego.body, self._caster).scene.cast(bundle)
        return hits.distance.reshape(columns, sensor.beams)

    def _azimuth(self) -> Array:
        columns = self.drawn.sensor.columns_at(self.drawn.rate_hz)
        sense = -1.0 if self.drawn.sensor.clockwise else 1.0
        return self._start_azimuth + sense * 2 * np.pi * np.arange(columns) / columns

    def _frame(self, index: int) -> tuple[Frame, Labels]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        index %= len(self)
        if self._last is None or self._last[0] != index:
            self._last = (index, *self._cast(index))
        return self._last[1], self._last[2]

    def _cast(self, index: int) -> tuple[Frame, Labels]:
        drawn, rng = self.drawn, np.random.default_rng([self.settings.seed, 3, index])
        azimuth = self._azimuth()
        share = (np.arange(len(azimuth)) + 0.5) / len(azimuth) - 0.5
        offsets = share * self._period if drawn.rolling_shutter else np.zeros(len(azimuth))
        times = self.stamp(index) + offsets
        poses = self.ego.trajectory.poses_at(times) @ self.ego.vehicle_from_sensor
        jitter = JITTER_RAD * drawn.realism.noise
        rays = aim(drawn.sensor, times, azimuth, poses, jitter, rng)
        met = self._stage.meet(rays, drawn.sensor, rng, drawn.sensor.max_range_m)
        met = _before_own_car(met, self._own, self.ego.body_removed)
        echoes = measure(met.shaped(self._own.shape), drawn.sensor, drawn.realism, self._bias, rng)
        return self._deliver(index, rays, offsets, met, echoes)

    def _deliver(
        self, index: int, rays: Rays, offsets: Array, met: Encounter, echoes: Echoes
    ) -> tuple[Frame, Labels]:
        """The points in the frame's coordinates, and their labels."""
        beams = self.drawn.sensor.beams
        distance = echoes.distance.ravel()
        back = np.isfinite(distance)
        kept = np.arange(len(distance)) if self.drawn.zeros else np.flatnonzero(back)
        column, ring, came = kept // beams, kept % beams, back[kept]
        seen = Seen(
            met.instance[kept],
            met.surface[kept],
            came & ~echoes.clutter.ravel()[kept],
            echoes.mixed.ravel()[kept],
        )
        sweep = self._sweep(index, rays)
        local = rays.local * np.where(back, distance, 0).reshape(echoes.distance.shape)[..., None]
        local[..., 2] += self.drawn.sensor.height.astype(np.float32)
        level = sweep.at_stamp(local).reshape(-1, 3).take(kept, axis=0)
        level[~came] = 0.0
        points = level
        if self.drawn.rolling_shutter and not self.drawn.compensated:
            points = self._mounted(local).reshape(-1, 3).take(kept, axis=0)
            points[~came] = 0.0
        frame = Frame(
            points=points,
            stamp=sweep.stamp,
            intensity=np.where(came, echoes.intensity.ravel()[kept], np.float32(0)),
            time_offset=offsets[column].astype(np.float32),
            ring=ring.astype(np.int16),
            name=f"{index:06d}",
        )
        reach = self.drawn.sensor.max_range_m + BOX_MARGIN_M
        labels = label(seen, self.movables, sweep.stamp, sweep.world_from_frame, reach)
        if self.drawn.rolling_shutter:
            carried = sweep.carry(level, labels.instance, column, self.actors)
            labels = replace(labels, points_at_stamp=carried)
        return frame, labels

    def _sweep(self, index: int, rays: Rays) -> Sweep:
        """The turn, from the sensor at each column to the frame's coordinates at the stamp."""
        stamp = self.stamp(index)
        world_from_frame = self.world_from_sensor(np.array([stamp]))[0]
        return Sweep(
            stamp, rays.times, invert(world_from_frame) @ rays.world_from_sensor, world_from_frame
        )

    def _mounted(self, local: NDArray[np.float32]) -> NDArray[np.float32]:
        """Points (C, B, 3) from the sensor's coordinates to the frame's, as measured."""
        if not self.drawn.vehicle_coordinates:
            return local
        mount = self.ego.vehicle_from_sensor.astype(np.float32)
        return (local @ mount[:3, :3].T + mount[:3, 3]).astype(np.float32)


def _before_own_car(met: Encounter, own: NDArray[np.float32], removed: bool) -> Encounter:
    """Put the own car's body before all else; taken out, it leaves nothing."""
    flat = own.ravel()
    nearer = flat < met.distance
    met.distance[nearer] = np.inf if removed else flat[nearer]
    met.surface[nearer] = Surface.OWN_CAR
    met.reflectivity[nearer] = 0.3
    met.slant[nearer] = 0.5
    met.instance[nearer] = 0
    return met


def simulate(settings: DriveSettings, caster: RayCaster | None = None) -> SimulatedSequence:
    """A simulated drive as a labelled sequence; frames are cast when asked for.

    A frame's stamp is the middle of its sweep; with a rolling shutter time offsets run from minus
    half to plus half a turn. Poses and boxes are those at the stamp. Points of the own car, of rain
    and fog, zeros and mixed edges are not ``annotated``.

    Args:
        settings: What to simulate.
        caster: Casts the rays; open3d or embreex, whichever there is, on one thread unless told.

    Raises:
        MissingDependencyError: When no caster is given and neither of them is installed.
    """
    return SimulatedSequence(settings, caster or usual_caster())
