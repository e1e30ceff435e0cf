"""The street as an Argoverse 2 sensor log: feather files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import feather

from driving_logs.street import EPOCH_S, ROOF, THINGS, Written, cast, pose, quaternion, vehicle_at
from lidaraccum.geometry import rigid


def write_argoverse2(root: Path, name: str = "01bb304d-7bd8-35f8-bbef-7086b688e35e") -> Written:
    """Four sweeps at 10 Hz, boxes at each; poses oftener than sweeps."""
    seconds, log = 0.1 * np.arange(4), root / name
    (log / "sensors" / "lidar").mkdir(parents=True)
    (log / "calibration").mkdir()
    boxes = []
    for time in seconds:
        made, nanos = cast(time), EPOCH_S * 1_000_000_000 + round(1e9 * time)
        x, y, z = made.seen_from(vehicle_at(time)).T.astype(np.float16)
        _feather(
            log / "sensors" / "lidar" / f"{nanos}.feather",
            {
                "x": x,
                "y": y,
                "z": z,
                "intensity": (made.row % 256).astype(np.uint8),
                "laser_number": made.row.astype(np.uint8),
                "offset_ns": (made.column * 400_000).astype(np.int32),
            },
        )
        for thing in THINGS:
            if time >= thing.drawn_from:
                box = rigid.invert(vehicle_at(time)) @ thing.at(time)
                boxes.append((nanos, thing.name, thing.words["argoverse2"], *thing.size, *_qt(box)))
    names = ["timestamp_ns", "track_uuid", "category", "length_m", "width_m", "height_m", *QT]
    rows = zip(*boxes, strict=True)
    columns = {key: np.array(values) for key, values in zip(names, rows, strict=True)}
    _feather(log / "annotations.feather", columns)
    times = np.arange(-1, 8) * 50_000_000
    placed = np.array([_qt(vehicle_at(1e-9 * time)) for time in times]).T
    poses = dict(zip(QT, placed, strict=True))
    stamps = EPOCH_S * 1_000_000_000 + times
    _feather(log / "city_SE3_egovehicle.feather", {"timestamp_ns": stamps, **poses})
    mounts = [pose(ROOF[0], ROOF[1], ROOF[2] + up, 0.0) for up in (0.04, -0.04)]
    placed = np.array([_qt(mount) for mount in [*mounts, np.eye(4)]]).T
    sensors = {"sensor_name": np.array(["up_lidar", "down_lidar", "ring_front_center"])}
    _feather(
        log / "calibration" / "egovehicle_SE3_sensor.feather",
        {**sensors, **dict(zip(QT, placed, strict=True))},
    )
    return Written("argoverse2", root, name, seconds, rigid.translation(-ROOF), tuple(range(4)))


QT = ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")


def _qt(motion: np.ndarray) -> list[float]:
    return [*quaternion(motion), *motion[:3, 3].tolist()]


def _feather(path: Path, columns: dict[str, np.ndarray]) -> None:
    feather.write_feather(pa.table({n: pa.array(v) for n, v in columns.items()}), str(path))
