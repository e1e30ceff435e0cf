"""A made-up car park to learn from: points on boxes, no ray caster, a few thousand points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from lidaraccum.data.frame import Box, Frame, Labels
from lidaraccum.geometry import rigid
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.training.augment import NO_AUGMENTATION
from lidaraccum.training.dataset import WindowSettings, cut_windows
from lidaraccum.training.window import TrainingWindow

SMALL = NetworkSettings(
    extent_m=16.0,
    base_widths=(16, 24, 32),
    motion_widths=(32, 48),
    ego_pillars=128,
    temporal_channels=16,
    temporal_blocks=1,
    point_channels=48,
    tube_channels=48,
)
WINDOWS = WindowSettings(
    extent_m=16.0,
    lengths=(3, 4),
    windows_per_drive=2,
    drive_frames=6,
    augment=replace(NO_AUGMENTATION, yaw_deg=20.0, jitter_m=0.005),
)
CAR, WALL = (4.2, 1.8, 1.5), (3.0, 0.4, 2.5)


def _surface(rng: np.random.Generator, size: tuple[float, float, float], count: int) -> np.ndarray:
    """(count, 3) points on the sides and the top of a box that stands on z = 0."""
    points = rng.uniform(-0.5, 0.5, (count, 3))
    axis = rng.integers(0, 3, count)
    sign = np.where(axis == 2, 0.5, np.where(rng.random(count) < 0.5, 0.5, -0.5))
    points[np.arange(count), axis] = sign
    return (points + np.array([0, 0, 0.5])) * size


def _pose(x: float, y: float, yaw: float) -> np.ndarray:
    pose = rigid.exponential(np.array([0, 0, yaw, 0, 0, 0.0]))
    pose[:2, 3] = x, y
    return pose


@dataclass(frozen=True)
class CarPark:
    """A labelled sequence: walls, cars that stand, cars that drive."""

    seed: int = 0
    frames: int = 6
    name: str = "car park"
    rate_hz: float = 10.0
    crs_wkt: str | None = None
    poses: np.ndarray | None = field(default=None, compare=False)

    def __len__(self) -> int:
        return self.frames

    def _scene(self) -> tuple[np.ndarray, np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
        rng = np.random.default_rng([self.seed, 5])
        walls = [_pose(*rng.uniform(-9, 9, 2), rng.uniform(0, 3)) for _ in range(9)]
        cars = []
        for index in range(5):
            start = _pose(*rng.uniform(-7, 7, 2), rng.uniform(-3, 3))
            speed = rng.uniform(2, 5) if index < 3 else 0.0
            cars.append((start, np.array([0, 0, 0, speed, 0, 0])))
        return rng.uniform(0.5, 4, 2), np.stack(walls), cars

    def _make(self, index: int) -> tuple[Frame, Labels]:
        ego, walls, cars = self._scene()
        rng = np.random.default_rng([self.seed, index, 6])
        time = index / self.rate_hz
        world_from_sensor = _pose(ego[0] * time, 0.2 * ego[1] * time, 0.05 * time)
        world_from_sensor[2, 3] = 1.7
        ground = np.column_stack([rng.uniform(-9, 9, (1200, 2)), np.zeros(1200)])
        parts, ids, boxes = [ground], [np.zeros(1200, int)], []
        for wall in walls:
            parts.append(rigid.transform(wall, _surface(rng, WALL, 120)))
            ids.append(np.zeros(120, int))
        for number, (start, twist) in enumerate(cars, start=1):
            pose = start @ rigid.exponential(twist * time)
            parts.append(rigid.transform(pose, _surface(rng, CAR, 150)))
            ids.append(np.full(150, number))
            moving = bool(twist.any())
            sensor_from_object = rigid.invert(world_from_sensor) @ pose
            boxes.append(Box(number, "Car", CAR, sensor_from_object, twist[3], moving))
        world, instance = np.concatenate(parts), np.concatenate(ids).astype(np.int32)
        movers = [box.id for box in boxes if box.dynamic]
        points = rigid.transform(rigid.invert(world_from_sensor), world)
        labels = Labels(
            world_from_sensor,
            foreground=instance > 0,
            dynamic=np.isin(instance, movers),
            instance=instance,
            boxes=tuple(boxes),
        )
        return Frame(points.astype(np.float32), stamp=time, name=str(index)), labels

    def __getitem__(self, index: int) -> Frame:
        return self._make(index)[0]

    def labels(self, index: int) -> Labels:
        return self._make(index)[1]


@dataclass(frozen=True)
class CarParks:
    """A source of windows; ``drives`` car parks, over and over, when that is not 0."""

    drives: int = 0
    settings: WindowSettings = WINDOWS
    network: NetworkSettings = SMALL

    def windows(self, drive: int) -> list[TrainingWindow]:
        number = drive % self.drives if self.drives else drive
        rng = np.random.default_rng([number, 7])
        return cut_windows(CarPark(number), self.network, self.settings, rng)
