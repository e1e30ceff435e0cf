"""The street as Waymo Open Dataset v2: a parquet file a component."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from driving_logs.street import (
    COLUMNS,
    EPOCH_S,
    INCLINATIONS,
    ROOF,
    ROWS,
    THINGS,
    Thing,
    Written,
    cast,
    column_times,
    pose,
    vehicle_at,
)
from lidaraccum.geometry import rigid


def write_waymo(root: Path, name: str = "10023947602400723454_1120_000_1140_000") -> Written:
    """Four frames at 10 Hz, each measured over 0.1 s; a second laser that is to be passed over.

    Each frame has one second return, the last one none.
    """
    seconds = 0.1 * np.arange(4)
    vehicle_from_laser = pose(*ROOF, 2.58)
    lidar, laser_poses, vehicles, boxes = [], [], [], []
    for time in seconds:
        made = cast(time, 0.1)
        key = {
            "key.segment_context_name": name,
            "key.frame_timestamp_micros": EPOCH_S * 1_000_000 + round(1e6 * time),
        }
        image = np.full((ROWS, COLUMNS, 4), -1.0, dtype="f4")
        image[made.row, made.column] = np.stack(
            [made.distance, made.row, made.column % 2, np.where(made.in_no_label_zone, 1.0, -1.0)],
            axis=1,
        )
        second = np.full_like(image, -1.0)
        second[5, 7] = [30.0, 2.0, 0.5, -1.0]
        second = second if time < seconds[-1] else None
        for laser, first in ((2, -image), (1, image)):
            images = _image("[LiDARComponent].range_image_return1", first)
            images |= _image("[LiDARComponent].range_image_return2", second)
            lidar.append({**key, "key.laser_name": laser, **images})
        columns = np.array([_angles(vehicle_at(at)) for at in column_times(time, 0.1)])
        every = np.broadcast_to(columns, (ROWS, COLUMNS, 6)).astype("f4")
        laser_poses.append(
            {
                **key,
                "key.laser_name": 1,
                **_image("[LiDARPoseComponent].range_image_return1", every),
            }
        )
        matrix = vehicle_at(time).ravel().tolist()
        vehicles.append({**key, "[VehiclePoseComponent].world_from_vehicle.transform": matrix})
        boxes += [
            {**key, "key.laser_object_id": thing.name, **_waymo_box(thing, time)}
            for thing in THINGS
            if time >= thing.drawn_from
        ]
    calibration = [
        {
            "key.segment_context_name": name,
            "key.laser_name": laser,
            "[LiDARCalibrationComponent].extrinsic.transform": vehicle_from_laser.ravel().tolist(),
            "[LiDARCalibrationComponent].beam_inclination.min": float(INCLINATIONS[0]),
            "[LiDARCalibrationComponent].beam_inclination.max": float(INCLINATIONS[-1]),
            "[LiDARCalibrationComponent].beam_inclination.values": values,
        }
        for laser, values in ((1, INCLINATIONS.tolist()), (2, None))
    ]
    for component, rows in (
        ("lidar", lidar),
        ("lidar_pose", laser_poses),
        ("lidar_calibration", calibration),
        ("lidar_box", boxes),
        ("vehicle_pose", vehicles),
    ):
        (root / component).mkdir(parents=True, exist_ok=True)
        table = pa.table(
            {name: pa.array([row[name] for row in rows], _type(name)) for name in rows[0]}
        )
        pq.write_table(table, root / component / f"{name}.parquet", row_group_size=3)
    frame = rigid.translation(-ROOF)
    return Written("waymo", root, name, seconds, frame, tuple(range(4)), sweep_s=0.1)


def _image(name: str, image: np.ndarray | None) -> dict[str, object]:
    if image is None:
        return {f"{name}.values": None, f"{name}.shape": None}
    return {f"{name}.values": image.ravel(), f"{name}.shape": np.array(image.shape, dtype="i4")}


def _type(column: str) -> pa.DataType | None:
    """The arrow type that Waymo declares for a column; None for plain numbers and texts."""
    if column.endswith(".beam_inclination.values"):
        return pa.list_(pa.float64())
    if column in ("key.laser_name", "[LiDARBoxComponent].type"):
        return pa.int8()
    kinds = {
        "values": pa.list_(pa.float32()),
        "shape": pa.list_(pa.int32(), 3),
        "transform": pa.list_(pa.float64(), 16),
    }
    return kinds.get(column.rpartition(".")[2])


def _angles(world_from_vehicle: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw and place (6,) of a pose that only turns about z."""
    yaw = np.arctan2(world_from_vehicle[1, 0], world_from_vehicle[0, 0])
    return np.array([0, 0, yaw, *world_from_vehicle[:3, 3]])


def _waymo_box(thing: Thing, seconds: float) -> dict[str, object]:
    box = rigid.invert(vehicle_at(seconds)) @ thing.at(seconds)
    numbers = {f"center.{axis}": float(box[row, 3]) for row, axis in enumerate("xyz")}
    numbers |= {f"size.{axis}": size for axis, size in zip("xyz", thing.size, strict=True)}
    numbers["heading"] = float(np.arctan2(box[1, 0], box[0, 0]))
    columns: dict[str, object] = {f"[LiDARBoxComponent].box.{k}": v for k, v in numbers.items()}
    return columns | {"[LiDARBoxComponent].type": int(thing.words["waymo"])}
