"""nuScenes: v1.0 JSON tables beside samples/ and sweeps/ of LIDAR_TOP."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.io.bin import read_bin
from lidaraccum.io.driving.log import DrivingLog, Sweep
from lidaraccum.io.driving.nuscenes_tables import (
    BoxRecord,
    MountRecord,
    NuScenesTables,
    PoseRecord,
    SweepRecord,
    tables_folder,
)
from lidaraccum.io.driving.poses import poses_of_parts
from lidaraccum.io.driving.tracks import DrawnBoxes
from lidaraccum.io.interpret import Occasion, frame_from_columns

MOVABLE = ("human.", "vehicle.", "animal")
"""How the names of movable categories begin; barriers, cones and the like are background."""
OWN_CAR_M = 2.5
"""Nearer points are on the own car: the lowest beam meets the ground 3.1 m away."""
SECONDS = 1e-6
PERIOD_S = 0.05


class NuScenes:
    """Scenes of one version, such as v1.0-mini; implements `DrivingDataset`.

    Frames are the LIDAR_TOP sweeps, about 20 a second, as delivered: in the sensor's own
    coordinates (x right, y ahead, z up), compensated for the car's motion by nuScenes, with
    intensity and ring and without a time per point. A sweep's pose is its ego pose times the
    mount. Boxes are drawn at key frames, about 2 a second, in the world; they count as drawn at the
    stamp of the key frame's sweep. Points within 2.5 m of the sensor are on the own car and not
    annotated.

    Args:
        root: The folder that holds the version's folder, samples and sweeps.
        version: The version's folder; where there is one only, it need not be named.
    """

    def __init__(self, root: Path, version: str | None = None) -> None:
        self._root = root
        self._folder = tables_folder(root, version)
        self._tables = NuScenesTables(self._folder)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all scenes."""
        return tuple(sorted(scene.name for scene in self._tables.scenes))

    def open(self, name: str) -> DrivingLog:
        """The scene of a name.

        Raises:
            InputError: A table lacks what it should hold.
        """
        scene = next(one for one in self._tables.scenes if one.name == name)
        sweeps = self._tables.sweeps.get(scene.token, [])
        stamps = SECONDS * np.array([sweep.timestamp for sweep in sweeps], dtype=np.float64)
        keys = {
            sweep.sample_token: float(stamp)
            for sweep, stamp in zip(sweeps, stamps, strict=True)
            if sweep.is_key_frame
        }
        return DrivingLog(
            name=name,
            dataset="nuScenes",
            sensor="HDL-32E",
            licence="CC BY-NC-SA 4.0 and the nuScenes terms of use",
            coordinates="LIDAR_TOP: x right, y ahead, z up",
            stamps=stamps,
            world_from_sensor=self._poses(sweeps),
            drawn_at=np.array(sorted(keys.values())),
            tracks=self._boxes(keys).tracks(),
            read=lambda index: self._read(sweeps[index], float(stamps[index])),
        )

    def _read(self, sweep: SweepRecord, stamp: float) -> Sweep:
        path = self._root / sweep.filename
        occasion = Occasion(path.name, stamp, PERIOD_S, exact=True)
        frame = frame_from_columns(read_bin(path), occasion)
        return Sweep(frame, scored=frame.ranges > OWN_CAR_M)

    def _poses(self, sweeps: list[SweepRecord]) -> NDArray[np.float64]:
        try:
            egos = [self._tables.egos[sweep.ego_pose_token] for sweep in sweeps]
        except KeyError as error:
            raise InputError(f"{self._folder / 'ego_pose.json'} lacks pose {error}") from error
        mounts = [self._tables.mounts[sweep.calibrated_sensor_token] for sweep in sweeps]
        world_from_ego = poses_of(egos, self._folder / "ego_pose.json")
        return world_from_ego @ poses_of(mounts, self._folder / "calibrated_sensor.json")

    def _boxes(self, keys: dict[str, float]) -> DrawnBoxes:
        drawn = [box for sample in keys for box in self._tables.drawn.get(sample, [])]
        words = [self._tables.words.get(box.instance_token, "") for box in drawn]
        rows = [row for row, word in enumerate(words) if word.startswith(MOVABLE)]
        kept = [drawn[row] for row in rows]
        width_length_height = np.array([box.size for box in kept], dtype=np.float64)
        return DrawnBoxes(
            names=[box.instance_token for box in kept],
            categories=[words[row].removeprefix("human.").removeprefix("vehicle.") for row in rows],
            stamps=np.array([keys[box.sample_token] for box in kept]),
            size_lwh=width_length_height.reshape(-1, 3)[:, [1, 0, 2]],
            world_from_object=poses_of(kept, self._folder / "sample_annotation.json"),
        )


def poses_of(
    records: list[PoseRecord] | list[MountRecord] | list[BoxRecord], path: Path
) -> NDArray[np.float64]:
    """Poses (M, 4, 4) of records of a table."""
    places = [record.translation for record in records]
    return poses_of_parts(places, [record.rotation for record in records], path)
