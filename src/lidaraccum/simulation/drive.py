"""A simulated drive: a labelled sequence like any other, cast frame by frame when asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Box, Frame, Labels
from lidaraccum.errors import SettingsError
from lidaraccum.geometry.rigid import invert
from lidaraccum.simulation.actors import Actor
from lidaraccum.simulation.ego import Ego, draw_body, draw_mount, drive_ego
from lidaraccum.simulation.motion import MANOEUVRES, sample_times, speed_profile
from lidaraccum.simulation.networks import SCENE_KINDS, draw_kind, lay_network
from lidaraccum.simulation.raycast import Open3DRayCaster, RayCaster
from lidaraccum.simulation.returns import (
    IDEAL,
    Echoes,
    Realism,
    draw_bias,
    draw_weather,
    measure,
)
from lidaraccum.simulation.scan import Encounter, Rays, Solid, Stage, aim
from lidaraccum.simulation.sensor import RANDOM_SENSOR, SENSORS, Sensor, sensor_by_name
from lidaraccum.simulation.surfaces import Surface
from lidaraccum.simulation.traffic import Traffic
from lidaraccum.simulation.world import World, build_world

Array = NDArray[np.float64]
DYNAMIC_MPS = 0.5
"""What moves faster is dynamic."""
JITTER_RAD = 0.0006
WEATHERS = ("clear", "rain", "fog", "snow")


@dataclass(frozen=True)
class DriveSettings:
    """What to simulate; whatever is None is drawn from the seed.

    Attributes:
        seed: 0 or more. The same settings give the same bytes.
        frames: How many.
        sensor: A name in ``SENSORS``, or ``random``.
        rate_hz: Turns a second.
        scene: One of ``SCENE_KINDS``.
        speed_mps: The ego's speed at the start (bends may keep it lower).
        manoeuvre: One of ``MANOEUVRES``: what the ego does with its speed.
        rolling_shutter: Each column measured at its own time, from where the sensor is then;
            otherwise all at the stamp.
        compensated: Points of a rolling shutter moved to the stamp by the true ego-motion, as
            data sets deliver them (movers stay smeared by their own motion).
        coordinates: ``sensor``, or ``vehicle``: on the ground under the car.
        weather: clear, rain, fog or snow.
        zeros: Whether pulses that never came back are delivered as points at 0, 0, 0.
        exact: Without noise, losses, mixed edges or weather; for tests of laws.
    """

    seed: int = 0
    frames: int = 5
    sensor: str | None = None
    rate_hz: float | None = None
    scene: str | None = None
    speed_mps: float | None = None
    manoeuvre: str | None = None
    rolling_shutter: bool | None = None
    compensated: bool | None = None
    coordinates: Literal["sensor", "vehicle"] | None = None
    weather: str | None = None
    zeros: bool | None = None
    exact: bool = False

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise SettingsError(f"a seed is 0 or more, not {self.seed}")
        if self.frames < 1:
            raise SettingsError(f"a drive has one frame or more, not {self.frames}")
        if self.rate_hz is not None and not 1.0 <= self.rate_hz <= 50.0:
            raise SettingsError(f"a sensor turns 1 to 50 times a second, not {self.rate_hz}")
        if self.speed_mps is not None and not 0.0 <= self.speed_mps <= 45.0:
            raise SettingsError(f"the ego drives 0 to 45 m/s, not {self.speed_mps}")
        for word, value, known in (
            ("sensor", self.sensor, (*SENSORS, RANDOM_SENSOR)),
            ("scene", self.scene, SCENE_KINDS),
            ("manoeuvre", self.manoeuvre, MANOEUVRES),
            ("weather", self.weather, WEATHERS),
            ("coordinates", self.coordinates, ("sensor", "vehicle")),
        ):
            if value is not None and value not in known:
                raise SettingsError(f"no {word} is called {value!r}", hint=f"known: {', '.join(known)}")


@dataclass(frozen=True)
class DrawnDrive:
    """Settings with nothing left open, and what follows from them."""

    sensor: Sensor
    rate_hz: float
    scene: str
    speed_mps: float
    manoeuvre: str
    rolling_shutter: bool
    compensated: bool
    vehicle_coordinates: bool
    zeros: bool
    realism: Realism


def draw_drive(settings: DriveSettings) -> DrawnDrive:
    """Fill in what the settings leave open. What is drawn does not depend on what is given."""
    rng = np.random.default_rng([settings.seed, 1])
    children = [_child(rng) for _ in range(6)]
    chance = rng.random(8)
    sensor_name = settings.sensor or _pick(chance[0], [*SENSORS, *[RANDOM_SENSOR] * 4])
    sensor = sensor_by_name(sensor_name, children[0])
    rate = settings.rate_hz or float(children[1].choice(sensor.rates_hz))
    drawn_speed = _draw_speed(children[2])
    speed = drawn_speed if settings.speed_mps is None else settings.speed_mps
    scene = settings.scene or draw_kind(speed, children[3])
    manoeuvre = settings.manoeuvre or _draw_manoeuvre(speed, children[4])
    rolling = _either(settings.rolling_shutter, chance[1] < 0.85)
    compensated = _either(settings.compensated, chance[2] < 0.5) and rolling
    vehicle = (settings.coordinates or ("vehicle" if chance[3] < 0.2 else "sensor")) == "vehicle"
    zeros = _either(settings.zeros, chance[4] < 0.12)
    weather = settings.weather or _pick(chance[5], ["clear"] * 16 + ["rain", "rain", "fog", "snow"])
    realism = _draw_realism(weather, children[5])
    return DrawnDrive(
        sensor, rate, scene, speed, manoeuvre, rolling, compensated, vehicle,
        zeros, IDEAL if settings.exact else realism,
    )  # fmt: skip


def _child(rng: np.random.Generator) -> np.random.Generator:
    return np.random.default_rng(rng.integers(2**63))


def _pick(chance: float, names: list[str]) -> str:
    return names[int(chance * len(names))]


def _either(given: bool | None, drawn: bool) -> bool:
    return bool(drawn) if given is None else given


def _draw_speed(rng: np.random.Generator) -> float:
    """0 to 30 m/s: standing, town, main road, motorway."""
    low, high = ((0, 0), (0.5, 9), (7, 15), (15, 22), (22, 30))[int(rng.choice(5, p=[0.15, 0.3, 0.35, 0.12, 0.08]))]
    return float(rng.uniform(low, high))


def _draw_manoeuvre(speed: float, rng: np.random.Generator) -> str:
    if speed < 0.2:
        return str(rng.choice(["stand", "pull away"], p=[0.8, 0.2]))
    return str(rng.choice(["cruise", "brake", "accelerate"], p=[0.7, 0.16, 0.14]))


def _draw_realism(weather: str, rng: np.random.Generator) -> Realism:
    return Realism(
        noise=float(rng.uniform(0.5, 1.4)),
        drop=float(rng.choice([0.002, 0.01, 0.03])),
        mixed=float(rng.uniform(0.02, 0.15)),
        weather=draw_weather(weather, rng),
    )


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
        network = lay_network(self.drawn.scene, reach, _child(rng))
        self.world: World = build_world(network, reach, _child(rng))
        self.ego = self._drive(duration, _child(rng))
        self.actors: tuple[Actor, ...] = Traffic(self.world, self.ego, _child(rng)).populate()
        self._bias = draw_bias(self.drawn.sensor, _child(rng))
        self._stage = Stage(self.world, self.actors, caster)
        self._start_azimuth = float(_child(rng).choice([np.pi, np.pi, 0.0, 0.5 * np.pi]))
        self._own = self._see_own_car()
        self._last: tuple[int, Frame, Labels] | None = None

    # -- the protocol --------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Scene, sensor and seed."""
        return f"simulated-{self.drawn.scene}-{self.drawn.sensor.name}-{self.settings.seed}"

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

    # -- casting ---------------------------------------------------------------------------------------

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
        return Ego(trajectory, mount, speeds, draw_body(mount, rng))

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
        met = _before_own_car(met, self._own)
        shape = self._own.shape
        echoes = measure(
            met.distance.reshape(shape), met.surface.reshape(shape),
            met.reflectivity.reshape(shape), met.slant.reshape(shape), drawn.sensor,
            drawn.realism, self._bias, rng,
        )  # fmt: skip
        return self._deliver(index, rays, offsets, met, echoes)

    def _deliver(
        self, index: int, rays: Rays, offsets: Array, met: Encounter, echoes: Echoes
    ) -> tuple[Frame, Labels]:
        """The points in the frame's coordinates, and their labels."""
        columns, beams = echoes.distance.shape
        distance = echoes.distance.ravel()
        back = np.isfinite(distance)
        kept = np.arange(len(distance)) if self.drawn.zeros else np.flatnonzero(back)
        column, ring = kept // beams, kept % beams
        came = back[kept]
        places = self._places(index, rays, np.where(back, distance, 0).reshape(columns, beams))
        points = places.reshape(-1, 3)[kept]
        points[~came] = 0.0
        frame = Frame(
            points=points,
            stamp=self.stamp(index),
            intensity=np.where(came, echoes.intensity.ravel()[kept], np.float32(0)),
            time_offset=offsets[column].astype(np.float32),
            ring=ring.astype(np.int16),
            name=f"{index:06d}",
        )
        solid = came & ~echoes.clutter.ravel()[kept]
        return frame, self._label(index, met, kept, solid, echoes)

    def _places(
        self, index: int, rays: Rays, distance: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """(C, B, 3) float32 metres in the frame's coordinates, from distances (C, B)."""
        points = rays.local * distance[..., None]
        points[..., 2] += self.drawn.sensor.height.astype(np.float32)
        frame_from_sensor = np.eye(4)[None]
        mount = self.ego.vehicle_from_sensor
        if self.drawn.compensated:
            stamp_pose = self.ego.trajectory.poses_at(np.array([self.stamp(index)]))[0] @ mount
            frame_from_sensor = invert(stamp_pose) @ rays.world_from_sensor
        if self.drawn.vehicle_coordinates:
            frame_from_sensor = mount @ frame_from_sensor
        rotation = np.swapaxes(frame_from_sensor[:, :3, :3], 1, 2).astype(np.float32)
        return points @ rotation + frame_from_sensor[:, None, :3, 3].astype(np.float32)

    def _label(
        self, index: int, met: Encounter, kept: NDArray[np.int64], solid: NDArray[np.bool_],
        echoes: Echoes,
    ) -> Labels:  # fmt: skip
        instance = np.where(solid, met.instance[kept], 0).astype(np.int32)
        surface = np.where(solid, met.surface[kept], np.uint8(Surface.CLUTTER))
        stamp = self.stamp(index)
        moving = [a.id for a in self.actors if a.trajectory.speed_at(stamp) > DYNAMIC_MPS]
        dynamic = np.zeros(len(self.world.stills) + len(self.actors) + 1, dtype=np.bool_)
        dynamic[moving] = True
        scored = solid & (surface != Surface.OWN_CAR) & ~echoes.mixed.ravel()[kept]
        pose = self.world_from_sensor(np.array([stamp]))[0]
        return Labels(
            world_from_sensor=pose,
            foreground=instance > 0,
            dynamic=dynamic[instance],
            instance=instance,
            boxes=self._boxes(stamp, pose),
            annotated=scored,
            semantic=surface.astype(np.int16),
        )

    def _boxes(self, stamp: float, world_from_sensor: Array) -> tuple[Box, ...]:
        """Boxes of all objects the sensor could reach from where it is."""
        driving = [actor.trajectory.poses_at(np.array([stamp]))[0] for actor in self.actors]
        speeds = [0.0] * len(self.world.stills)
        speeds += [actor.trajectory.speed_at(stamp) for actor in self.actors]
        movables = [*self.world.stills, *self.actors]
        if not movables:
            return ()
        poses = np.stack([*(still.world_from_object for still in self.world.stills), *driving])
        half = 0.5 * np.array([movable.model.size_lwh[2] for movable in movables])
        poses[:, :3, 3] += half[:, None] * poses[:, :3, 2]
        seen_from = invert(world_from_sensor) @ poses
        reach = np.linalg.norm(seen_from[:, :3, 3], axis=1)
        near = np.flatnonzero(reach < self.drawn.sensor.max_range_m + 20.0)
        return tuple(
            Box(
                movables[row].id, movables[row].model.category, movables[row].model.size_lwh,
                seen_from[row], speeds[row], speeds[row] > DYNAMIC_MPS,
            )
            for row in near
        )  # fmt: skip


def _before_own_car(met: Encounter, own: NDArray[np.float32]) -> Encounter:
    """Put the own car's body before all else."""
    flat = own.ravel()
    nearer = flat < met.distance
    met.distance[nearer] = flat[nearer]
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
        caster: Casts the rays; Open3D on one thread unless told.

    Raises:
        MissingDependencyError: When no caster is given and open3d is not installed.
    """
    return SimulatedSequence(settings, caster or Open3DRayCaster())
