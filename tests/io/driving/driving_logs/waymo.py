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
    """Four frames at 10 Hz, each measured over 0.1 s; a second laser that is to be passed over."""
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
        for laser in (2, 1):
            lidar.append(
                {
                    **key,
                    "key.laser_name": laser,
                    **_image(
                        "[LiDARComponent].range_image_return1", image if laser == 1 else -image
                    ),
                    **_image("[LiDARComponent].range_image_return2", second),
                }
            )
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
        table = pa.table({column: _column([row[column] for row in rows]) for column in rows[0]})
        pq.write_table(table, root / component / f"{name}.parquet", row_group_size=3)
    frame = rigid.translation(-ROOF)
    return Written("waymo", root, name, seconds, frame, tuple(range(4)), sweep_s=0.1)


def _image(name: str, image: np.ndarray) -> dict[str, object]:
    return {f"{name}.values": image.ravel(), f"{name}.shape": np.array(image.shape, dtype="i4")}


def _column(values: list[object]) -> pa.Array:
    """Values as Waymo types them; arrays become lists."""
    if isinstance(values[0], np.ndarray):
        kind = pa.int32() if values[0].dtype.kind == "i" else pa.float32()
        return pa.array(values, pa.list_(kind))
    return pa.array(values)


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
