"""One segment of the Waymo Open Dataset v2: range images and boxes of the top laser."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.io.columns import Columns
from lidaraccum.io.driving.log import Sweep
from lidaraccum.io.driving.range_image import (
    ELONGATION,
    INTENSITY,
    NO_LABEL_ZONE,
    LaserCalibration,
    Pixels,
    compensated,
    vehicle_points,
)
from lidaraccum.io.driving.tables import ParquetRows, Table, read_parquet
from lidaraccum.io.driving.tracks import DrawnBoxes
from lidaraccum.io.interpret import Occasion, frame_from_columns
from lidaraccum.io.poses import orthonormal

TOP = 1
"""The roof's laser: 64 beams, 75 m; the other four see 20 m."""
WORDS = {1: "vehicle", 2: "pedestrian", 4: "cyclist"}
"""Movable types; signs (3) and unknown (0) are background."""
RETURNS = (1, 2)
SECONDS = 1e-6
PERIOD_S = 0.1

STAMP, LASER, OBJECT = "key.frame_timestamp_micros", "key.laser_name", "key.laser_object_id"
IMAGE = "[LiDARComponent].range_image_return"
PIXEL_POSE = "[LiDARPoseComponent].range_image_return1"
MOUNT = "[LiDARCalibrationComponent].extrinsic.transform"
BEAMS = "[LiDARCalibrationComponent].beam_inclination"
BOX = "[LiDARBoxComponent]"
BOX_NUMBERS = [f"{BOX}.box.{part}.{axis}" for part in ("center", "size") for axis in "xyz"]


class Segment:
    """The large components of one segment.

    Args:
        root: The folder of the components' folders.
        name: The segment's.
        micros: (T,) increasing stamps of its frames, microseconds.
        world_from_vehicle: (T, 4, 4).
    """

    def __init__(
        self, root: Path, name: str, micros: NDArray[np.int64], world_from_vehicle: rigid.Pose
    ) -> None:
        self._root, self._name = root, name
        self._micros, self._poses = micros, world_from_vehicle
        parts = [f"{IMAGE}{number}.{part}" for number in RETURNS for part in ("values", "shape")]
        self._images = ParquetRows(self._path("lidar"), parts)
        self._pixel_poses = ParquetRows(
            self._path("lidar_pose"), [f"{PIXEL_POSE}.values", f"{PIXEL_POSE}.shape"]
        )
        self._image_rows = self._rows("lidar")
        self._pose_rows = self._rows("lidar_pose")

    @cached_property
    def calibration(self) -> LaserCalibration:
        """Of the top laser."""
        path = self._path("lidar_calibration")
        parts = [f"{BEAMS}.{part}" for part in ("min", "max", "values")]
        table = read_parquet(path, [LASER, MOUNT, *parts])
        rows = np.flatnonzero(table[LASER] == TOP)
        if not len(rows):
            raise InputError(f"{path} has no laser {TOP} (top)")
        lowest, highest, values = (table[part][rows[0]] for part in parts)
        return LaserCalibration(
            transforms_of(table[MOUNT][rows[:1]], path)[0],
            float(lowest),
            float(highest),
            None if values is None else np.asarray(values, dtype=np.float64),
        )

    def boxes(self) -> DrawnBoxes:
        """Boxes of all that can move, in the world."""
        path = self._path("lidar_box")
        heading, kind = f"{BOX}.box.heading", f"{BOX}.type"
        table = read_parquet(path, [STAMP, OBJECT, kind, heading, *BOX_NUMBERS])
        kept = np.flatnonzero(
            np.isin(table[kind], list(WORDS)) & np.isin(table[STAMP], self._micros)
        )
        frame = np.searchsorted(self._micros, table[STAMP][kept])
        numbers = np.stack([table[name][kept] for name in BOX_NUMBERS], axis=1).astype(np.float64)
        yaw = table[heading][kept].astype(np.float64)
        vehicle_from_box = np.tile(np.eye(4), (len(kept), 1, 1))
        vehicle_from_box[:, 0, 0] = vehicle_from_box[:, 1, 1] = np.cos(yaw)
        vehicle_from_box[:, 1, 0], vehicle_from_box[:, 0, 1] = np.sin(yaw), -np.sin(yaw)
        vehicle_from_box[:, :3, 3] = numbers[:, :3]
        return DrawnBoxes(
            names=[str(table[OBJECT][row]) for row in kept],
            categories=[WORDS[int(table[kind][row])] for row in kept],
            stamps=SECONDS * self._micros[frame].astype(np.float64),
            size_lwh=numbers[:, 3:],
            world_from_object=self._poses[frame] @ vehicle_from_box,
        )

    def sweep(self, index: int) -> Sweep:
        """Both returns of a frame's top laser.

        Raises:
            InputError: The frame has no range image, or no pose image of its size.
        """
        stamp = int(self._micros[index])
        images = self._images.row(self._row_of(self._image_rows, "lidar", stamp))
        pose_lists = self._pixel_poses.row(self._row_of(self._pose_rows, "lidar_pose", stamp))
        pose_image = self._image(pose_lists, PIXEL_POSE, "lidar_pose")
        if pose_image is None:
            raise InputError(f"{self._path('lidar_pose')} has no poses at {stamp}")
        origin = self.calibration.vehicle_from_laser[:3, 3]
        points, pixels = [], []
        for number in RETURNS:
            image = self._image(images, f"{IMAGE}{number}", "lidar")
            if image is None:
                continue
            if image.shape[:2] != pose_image.shape[:2]:
                raise InputError(
                    f"{self._path('lidar')}: range image {image.shape}, poses {pose_image.shape}"
                )
            back = Pixels.of(image)
            measured = vehicle_points(back, self.calibration)
            at_pose = compensated(measured, back, pose_image, self._poses[index])
            points.append(at_pose - origin)
            pixels.append((number, back))
        return self._delivered(stamp, points, pixels)

    def _delivered(
        self, stamp: int, points: list[NDArray[np.float64]], pixels: list[tuple[int, Pixels]]
    ) -> Sweep:
        if not points:
            raise InputError(
                f"{self._path('lidar')} has no range image of the top laser at {stamp}"
            )
        values = np.concatenate([back.values for _, back in pixels])
        columns = {
            "intensity": values[:, INTENSITY],
            "ring": np.concatenate([back.row for _, back in pixels]).astype(np.uint16),
            "elongation": values[:, ELONGATION],
            "return_number": np.concatenate(
                [np.full(len(back.row), number, dtype=np.uint8) for number, back in pixels]
            ),
        }
        occasion = Occasion(f"{self._name}/{stamp}", SECONDS * stamp, PERIOD_S, exact=True)
        xyz = np.concatenate(points).astype(np.float32)
        frame = frame_from_columns(Columns(xyz, columns), occasion)
        outside = values[:, NO_LABEL_ZONE] <= 0
        return Sweep(frame, outside if frame.rows is None else outside[frame.rows])

    def _image(
        self, lists: dict[str, NDArray[Any] | None], name: str, component: str
    ) -> NDArray[np.float32] | None:
        values, shape = lists[f"{name}.values"], lists[f"{name}.shape"]
        if values is None or shape is None:
            return None
        if len(shape) != 3 or int(np.prod(shape)) != len(values):
            raise InputError(
                f"{self._path(component)}: {name} has {len(values)} values for shape {shape}"
            )
        return np.asarray(values, dtype=np.float32).reshape(shape)

    def _rows(self, component: str) -> dict[int, int]:
        """Rows of the top laser in a component's file, by stamp."""
        keys: Table = read_parquet(self._path(component), [STAMP, LASER])
        rows = np.flatnonzero(keys[LASER] == TOP)
        return dict(zip(keys[STAMP][rows].tolist(), rows.tolist(), strict=True))

    def _row_of(self, rows: dict[int, int], component: str, stamp: int) -> int:
        if stamp not in rows:
            raise InputError(f"{self._path(component)} has nothing of the top laser at {stamp}")
        return rows[stamp]

    def _path(self, component: str) -> Path:
        return self._root / component / f"{self._name}.parquet"


def transforms_of(flattened: NDArray[Any], path: Path) -> rigid.Pose:
    """Poses (M, 4, 4) of M lists of 16 numbers, row by row."""
    try:
        poses = np.array([np.asarray(one, dtype=np.float64) for one in flattened]).reshape(-1, 4, 4)
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: a transform is not 16 numbers") from error
    if not np.isfinite(poses).all():
        raise InputError(f"{path}: a transform holds non-finite numbers")
    return orthonormal(poses, path)
