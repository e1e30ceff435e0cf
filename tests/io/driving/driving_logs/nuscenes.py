"""The street as nuScenes v1.0: JSON tables, samples and sweeps."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from driving_logs.street import EPOCH_S, ROOF, THINGS, Written, cast, pose, quaternion, vehicle_at
from lidaraccum.geometry import rigid


def parts(motion: np.ndarray) -> dict[str, list[float]]:
    """A pose as nuScenes writes it."""
    return {"translation": motion[:3, 3].tolist(), "rotation": quaternion(motion)}


def write_nuscenes(root: Path) -> Written:
    """Eleven sweeps at 20 Hz, boxes at every fifth."""
    vehicle_from_lidar = pose(*ROOF, -np.pi / 2)
    seconds, keys = 0.05 * np.arange(11), (0, 5, 10)
    data: list[dict[str, object]] = []
    egos: list[dict[str, object]] = []
    for index, time in enumerate(seconds):
        micros = EPOCH_S * 1_000_000 + round(1e6 * time)
        is_key = index in keys
        folder = "samples" if is_key else "sweeps"
        filename = f"{folder}/LIDAR_TOP/n008__LIDAR_TOP__{micros}.pcd.bin"
        made = cast(time)
        world_from_lidar = vehicle_at(time) @ vehicle_from_lidar
        xyz = made.seen_from(world_from_lidar)
        (root / filename).parent.mkdir(parents=True, exist_ok=True)
        table = np.column_stack([xyz, made.row % 256, made.row]).astype("<f4")
        table.tofile(root / filename)
        egos.append({"token": f"ego{index}", "timestamp": micros, **parts(vehicle_at(time))})
        data.append(
            {
                "token": f"data{index}",
                "sample_token": f"sample{min(key for key in keys if key >= index)}",
                "ego_pose_token": f"ego{index}",
                "calibrated_sensor_token": "mount-lidar",
                "filename": filename,
                "fileformat": "pcd",
                "width": 0,
                "height": 0,
                "timestamp": micros,
                "is_key_frame": is_key,
                "next": "",
                "prev": "",
            }
        )
        camera = {**data[-1], "token": f"image{index}", "calibrated_sensor_token": "mount-camera"}
        data.append(camera)
    tables = {
        "scene": [{"token": "scene", "name": "scene-0061", "log_token": "log"}],
        "sample": [
            {
                "token": f"sample{key}",
                "scene_token": "scene",
                "timestamp": 0,
                "next": "",
                "prev": "",
            }
            for key in keys
        ],
        "sensor": [
            {"token": "lidar", "channel": "LIDAR_TOP", "modality": "lidar"},
            {"token": "camera", "channel": "CAM_FRONT", "modality": "camera"},
        ],
        "calibrated_sensor": [
            {"token": "mount-lidar", "sensor_token": "lidar", **parts(vehicle_from_lidar)},
            {"token": "mount-camera", "sensor_token": "camera", **parts(np.eye(4))},
        ],
        "sample_data": data,
        "ego_pose": egos,
        "category": [
            {"token": f"category-{thing.name}", "name": thing.words["nuscenes"], "description": ""}
            for thing in THINGS
        ],
        "instance": [
            {"token": thing.name, "category_token": f"category-{thing.name}", "nbr_annotations": 3}
            for thing in THINGS
        ],
        "sample_annotation": [
            {
                "token": f"{thing.name}{key}",
                "sample_token": f"sample{key}",
                "instance_token": thing.name,
                "size": [thing.size[1], thing.size[0], thing.size[2]],
                **parts(thing.at(seconds[key])),
                "attribute_tokens": [],
                "num_lidar_pts": 10,
            }
            for thing in THINGS
            for key in keys
            if seconds[key] >= thing.drawn_from
        ],
    }
    (root / "v1.0-mini").mkdir()
    for name, rows in tables.items():
        (root / "v1.0-mini" / f"{name}.json").write_text(json.dumps(rows))
    mount = rigid.invert(vehicle_from_lidar)
    return Written("nuscenes", root, "scene-0061", seconds, mount, keys)
