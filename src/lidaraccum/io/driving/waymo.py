"""Waymo Open Dataset v2 (perception): one parquet file a component and segment."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from lidaraccum.geometry import rigid
from lidaraccum.io.driving.log import DrivingLog, nothing_in
from lidaraccum.io.driving.tables import read_parquet
from lidaraccum.io.driving.waymo_segment import SECONDS, STAMP, Segment, transforms_of

VEHICLE_POSE = "[VehiclePoseComponent].world_from_vehicle.transform"


class Waymo:
    """Segments of one split; implements `DrivingDataset`.

    Frames hold the points of the top laser, both returns (``return_number`` 1 and 2), about 10 a
    second, in the vehicle's axes (x ahead, y left, z up) with the origin at the laser. Each point
    is taken by its pixel's pose from when it was measured to the frame's pose, so the vehicle's
    motion is undone; there is no time per point. Intensity and elongation are as delivered, ring is
    the range image's row. Boxes are drawn at every frame, in the vehicle's coordinates. Points in
    no-label zones are not annotated. The stamp is the frame's, the start of the sweep, while the
    pose is about its middle (Waymo's own convention).

    Args:
        root: The folder that holds the components' folders: lidar, lidar_box, ...
    """

    def __init__(self, root: Path) -> None:
        self._root = root

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all segments.

        Raises:
            MissingInputError: There is none.
        """
        found = tuple(sorted(path.stem for path in (self._root / "lidar").glob("*.parquet")))
        if not found:
            splits = sorted(path.parent.name for path in self._root.glob("*/lidar"))
            layout = "the folder that holds lidar/NAME.parquet, lidar_box/NAME.parquet, ..."
            raise nothing_in(self._root, "Waymo v2 segment", splits, layout)
        return found

    def open(self, name: str) -> DrivingLog:
        """The segment of a name.

        Raises:
            InputError: A component is missing or lacks what it should hold.
        """
        vehicles = read_parquet(self._path("vehicle_pose", name), [STAMP, VEHICLE_POSE])
        order = np.argsort(vehicles[STAMP])
        micros = vehicles[STAMP][order]
        world_from_vehicle = transforms_of(
            vehicles[VEHICLE_POSE][order], self._path("vehicle_pose", name)
        )
        segment = Segment(self._root, name, micros, world_from_vehicle)
        vehicle_from_sensor = rigid.translation(segment.calibration.vehicle_from_laser[:3, 3])
        stamps = SECONDS * micros.astype(np.float64)
        return DrivingLog(
            name=name,
            dataset="Waymo",
            sensor="Waymo top laser",
            licence="Waymo Dataset License Agreement for Non-Commercial Use",
            coordinates="the vehicle's axes (x ahead, y left, z up), origin at the top laser",
            stamps=stamps,
            world_from_sensor=world_from_vehicle @ vehicle_from_sensor,
            drawn_at=stamps,
            tracks=segment.boxes().tracks(),
            read=segment.sweep,
        )

    def _path(self, component: str, name: str) -> Path:
        return self._root / component / f"{name}.parquet"
