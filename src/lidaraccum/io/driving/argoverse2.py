"""Argoverse 2 sensor logs: one feather file a sweep, tables of poses, boxes and mounts."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError, MissingInputError
from lidaraccum.geometry import rigid
from lidaraccum.io.columns import Columns
from lidaraccum.io.driving.log import DrivingLog, Sweep, nothing_in
from lidaraccum.io.driving.poses import poses_of_parts
from lidaraccum.io.driving.tables import Table, read_feather
from lidaraccum.io.driving.tracks import DrawnBoxes, pose_between
from lidaraccum.io.interpret import Occasion, frame_from_columns

LASERS = ("up_lidar", "down_lidar")
BACKGROUND = frozenset(
    {
        "BOLLARD",
        "CONSTRUCTION_BARREL",
        "CONSTRUCTION_CONE",
        "MOBILE_PEDESTRIAN_CROSSING_SIGN",
        "MOBILE_PEDESTRIAN_SIGN",
        "SIGN",
        "STOP_SIGN",
    }
)
"""What stands by itself; everything else that is drawn can move (as in the scene flow challenge,
which counts trailers with signs and lights as vehicles)."""
PLACE, TURN, SIZE = (
    ("tx_m", "ty_m", "tz_m"),
    ("qw", "qx", "qy", "qz"),
    ("length_m", "width_m", "height_m"),
)
STAMP = "timestamp_ns"
SECONDS = 1e-9
PERIOD_S = 0.1
LONGEST_GAP_NS = 200_000_000
"""Between two poses; sweeps in a longer gap have none."""


class Argoverse2:
    """Logs of one split, or one log; implements `DrivingDataset`.

    Frames hold the points of the two stacked 32-beam sensors together, 10 a second, in the
    egovehicle's axes (x ahead, y left, z up) with the origin midway between the two sensors, which
    are 8 cm apart. Argoverse has compensated them for the vehicle's motion to the sweep's stamp.
    That is why ``offset_ns``, when each point was measured after the stamp, is carried as it is
    and not as the frame's time per point, by which the motion would be undone a second time.
    Intensity is as delivered, ring is the laser number (both sensors: 0 to 63). Boxes are drawn at
    every sweep, in the egovehicle's coordinates, within 5 m of the drivable area only.

    Args:
        root: The folder that holds the logs' folders, or a log's own.
    """

    def __init__(self, root: Path) -> None:
        self._root = root

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all logs.

        Raises:
            MissingInputError: There is none.
        """
        if (self._root / "sensors" / "lidar").is_dir():
            return (self._root.resolve().name,)
        found = tuple(sorted(path.parents[1].name for path in self._root.glob("*/sensors/lidar")))
        if not found:
            splits = sorted({path.parents[2].name for path in self._root.glob("*/*/sensors/lidar")})
            layout = "a log, or a folder of logs that hold sensors/lidar/*.feather"
            raise nothing_in(self._root, "Argoverse 2 log", splits, layout)
        return found

    def open(self, name: str) -> DrivingLog:
        """The log of a name.

        Raises:
            InputError: A table is missing or lacks what it should hold.
        """
        folder = self._root / name if (self._root / name).is_dir() else self._root
        files = sorted((folder / "sensors" / "lidar").glob("*.feather"), key=stamp_of)
        nanos = np.array([stamp_of(path) for path in files], dtype=np.int64)
        world_from_ego = poses_at(nanos, folder / "city_SE3_egovehicle.feather")
        ego_from_sensor = rigid.translation(origin_of(folder))
        boxes = boxes_of(folder / "annotations.feather", nanos, world_from_ego)
        return DrivingLog(
            name=name,
            dataset="Argoverse 2",
            sensor="two stacked VLP-32C",
            licence="CC BY-NC-SA 4.0 and the Argoverse terms of use",
            coordinates="egovehicle axes (x ahead, y left, z up), origin between the two sensors",
            stamps=SECONDS * nanos.astype(np.float64),
            world_from_sensor=world_from_ego @ ego_from_sensor,
            drawn_at=np.unique(boxes.stamps),
            tracks=movable(boxes).tracks(),
            read=lambda index: sweep_of(files[index], ego_from_sensor[:3, 3]),
        )


def stamp_of(path: Path) -> int:
    """The stamp of a sweep's file, nanoseconds.

    Raises:
        InputError: Its name is no number.
    """
    if not path.stem.isdecimal():
        raise InputError(f"{path} is not called like a sweep, TIMESTAMP_NS.feather")
    return int(path.stem)


def sweep_of(path: Path, origin: NDArray[np.float64]) -> Sweep:
    """One sweep, its coordinates counted from ``origin`` (3,), metres, egovehicle coordinates."""
    table = read_feather(path, ["x", "y", "z", "intensity", "laser_number", "offset_ns"])
    # The files hold half floats: 3 cm apart at 50 m.
    xyz = np.stack([table[axis].astype(np.float64) for axis in "xyz"], axis=1) - origin
    columns = {
        "intensity": table["intensity"],
        "ring": table["laser_number"],
        "offset_ns": table["offset_ns"],
    }
    occasion = Occasion(path.name, SECONDS * stamp_of(path), PERIOD_S, exact=True)
    return Sweep(frame_from_columns(Columns(xyz.astype(np.float32), columns), occasion))


def origin_of(folder: Path) -> NDArray[np.float64]:
    """Midway (3,) between the two sensors, metres, egovehicle coordinates.

    Raises:
        InputError: The mount of one is missing.
    """
    path = folder / "calibration" / "egovehicle_SE3_sensor.feather"
    table = read_feather(path, ["sensor_name", *PLACE])
    rows = [np.flatnonzero(table["sensor_name"] == laser) for laser in LASERS]
    missing = [laser for laser, found in zip(LASERS, rows, strict=True) if not len(found)]
    if missing:
        raise InputError(f"{path} has no {' and no '.join(missing)}")
    return np.mean([stacked(table, PLACE)[found[0]] for found in rows], axis=0)


def poses_at(nanos: NDArray[np.int64], path: Path) -> NDArray[np.float64]:
    """world_from_egovehicle (T, 4, 4) at stamps (T,) in nanoseconds, between the table's own.

    Raises:
        InputError: There are no poses about a stamp.
    """
    table = read_feather(path, [STAMP, *TURN, *PLACE])
    order = np.argsort(table[STAMP], kind="stable")
    known = table[STAMP][order].astype(np.int64)
    poses = poses_of_parts(stacked(table, PLACE)[order], stacked(table, TURN)[order], path)
    found = []
    for stamp in nanos.tolist():
        row = int(np.searchsorted(known, stamp))
        if row < len(known) and known[row] == stamp:
            found.append(poses[row])
            continue
        if not 0 < row < len(known) or known[row] - known[row - 1] > LONGEST_GAP_NS:
            raise InputError(f"{path} has no pose about the sweep at {stamp}")
        share = (stamp - known[row - 1]) / (known[row] - known[row - 1])
        found.append(pose_between(poses[row - 1], poses[row], float(share)))
    return np.array(found).reshape(-1, 4, 4)


def boxes_of(
    path: Path, nanos: NDArray[np.int64], world_from_ego: NDArray[np.float64]
) -> DrawnBoxes:
    """All boxes drawn at a sweep's stamp, in the world."""
    if not path.exists():
        raise MissingInputError(f"{path} does not exist", hint="test splits come without boxes")
    table = read_feather(path, [STAMP, "track_uuid", "category", *SIZE, *TURN, *PLACE])
    kept = np.flatnonzero(np.isin(table[STAMP], nanos))
    sweep = np.searchsorted(nanos, table[STAMP][kept])
    ego_from_box = poses_of_parts(stacked(table, PLACE)[kept], stacked(table, TURN)[kept], path)
    return DrawnBoxes(
        names=[str(name) for name in table["track_uuid"][kept]],
        categories=[str(word) for word in table["category"][kept]],
        stamps=SECONDS * nanos[sweep].astype(np.float64),
        size_lwh=stacked(table, SIZE)[kept],
        world_from_object=world_from_ego[sweep] @ ego_from_box,
    )


def movable(boxes: DrawnBoxes) -> DrawnBoxes:
    """Those of things that can move."""
    rows = [row for row, word in enumerate(boxes.categories) if word not in BACKGROUND]
    return DrawnBoxes(
        names=[boxes.names[row] for row in rows],
        categories=[boxes.categories[row].lower() for row in rows],
        stamps=boxes.stamps[rows],
        size_lwh=boxes.size_lwh[rows],
        world_from_object=boxes.world_from_object[rows],
    )


def stacked(table: Table, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Columns side by side, (N, len(names))."""
    return np.stack([table[name].astype(np.float64) for name in names], axis=1)
