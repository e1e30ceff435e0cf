"""Drives kept on the disk: made once, cut anew each time, where making them is what takes time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Box, Frame, Labels
from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.errors import SettingsError
from lidaraccum.io.atomic import atomic
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.training.cutting import WindowSettings, cut_windows
from lidaraccum.training.window import TrainingWindow


@dataclass(frozen=True)
class KeptDrives:
    """So many different drives, each stored when it is first asked for.

    The series of drives has no end: it goes through all of them in an order of its own, again and
    again, and cuts other windows with other changes each time. What a number gives does not depend
    on what is stored already.

    Attributes:
        folder: Where drives are stored, a file each; other settings need another folder.
        make_drive: Makes the drive of a number from 0; a picklable function.
        distinct: How many different drives there are.
        network: Its grid.
        settings: How windows are cut.
        seed: Of the order and of the cuts.
    """

    folder: Path
    make_drive: Callable[[int], LabelledSequence]
    distinct: int
    network: NetworkSettings
    settings: WindowSettings = field(default_factory=WindowSettings)
    seed: int = 0

    def __post_init__(self) -> None:
        if self.distinct < 1:
            raise SettingsError("at least 1 drive must be kept")

    def windows(self, drive: int) -> list[TrainingWindow]:
        """Windows of one of the drives, cut in a way of this number's own."""
        turn, place = divmod(drive, self.distinct)
        order = np.random.default_rng([self.seed, turn, 3]).permutation(self.distinct)
        stored = self.stored(int(order[place]))
        rng = np.random.default_rng([self.seed, drive, 4])
        return cut_windows(stored, self.network, self.settings, rng)

    def stored(self, number: int) -> LabelledSequence:
        """A drive, made and stored unless it is there, cropped to what its windows can reach."""
        path = self._path(number)
        if not path.exists():
            # A grid may be turned any way about the sensor: its corner reaches the furthest.
            reach = self.settings.extent_m * np.sqrt(0.5)
            store_drive(self.make_drive(number), path, reach)
        return StoredDrive(path)

    def missing(self) -> list[int]:
        """Numbers of the drives that are not stored yet."""
        return [number for number in range(self.distinct) if not self._path(number).exists()]

    def _path(self, number: int) -> Path:
        return self.folder / f"{number:06d}.npz"


def store_drive(drive: LabelledSequence, path: Path, reach_m: float) -> None:
    """Write what training needs of a drive: points within reach, labels, boxes, poses."""
    columns: dict[str, NDArray[np.generic]] = {}
    stamps, poses = [], []
    for index in range(len(drive)):
        frame, labels = drive[index], drive.labels(index)
        kept = frame.returned & (np.hypot(frame.points[:, 0], frame.points[:, 1]) < reach_m)
        stamps.append(frame.stamp)
        poses.append(labels.world_from_sensor)
        columns[f"points_{index}"] = frame.points[kept]
        columns[f"instance_{index}"] = labels.instance[kept]
        told = np.ones(len(frame), bool) if labels.annotated is None else labels.annotated
        flags = np.stack([labels.foreground, labels.dynamic, told])[:, kept]
        columns[f"flags_{index}"] = np.packbits(flags, axis=0)
        if frame.ring is not None:
            columns[f"ring_{index}"] = frame.ring[kept].astype(np.uint16)
        boxes = labels.boxes
        columns[f"box_ids_{index}"] = np.array(
            [[b.id, b.dynamic] for b in boxes], dtype=np.int64
        ).reshape(-1, 2)
        columns[f"box_poses_{index}"] = np.array([b.sensor_from_object for b in boxes])
        columns[f"box_numbers_{index}"] = np.array([[*b.size_lwh, b.speed_mps] for b in boxes])
        columns[f"box_names_{index}"] = np.array([b.category for b in boxes], dtype=np.str_)
    with atomic(path, overwrite=True) as made, made.open("wb") as file:
        np.savez(file, stamps=np.array(stamps), poses=np.array(poses), **columns)  # type: ignore[arg-type]


class StoredDrive:
    """A drive that `store_drive` wrote. Lazy: a frame is read when it is asked for."""

    crs_wkt: str | None = None

    def __init__(self, path: Path) -> None:
        self.name = path.stem
        self._file = np.load(path, allow_pickle=False)
        self._stamps: NDArray[np.float64] = self._file["stamps"]
        self.poses: NDArray[np.float64] | None = self._file["poses"]

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return float((len(self._stamps) - 1) / (self._stamps[-1] - self._stamps[0]))

    def __len__(self) -> int:
        return len(self._stamps)

    def __getitem__(self, index: int) -> Frame:
        ring = f"ring_{index}"
        return Frame(
            points=self._file[f"points_{index}"],
            stamp=float(self._stamps[index]),
            ring=self._file.get(ring),
            name=f"{self.name}/{index}",
        )

    def labels(self, index: int) -> Labels:
        """The truth about a frame."""
        instance = self._file[f"instance_{index}"]
        foreground, dynamic, told = np.unpackbits(
            self._file[f"flags_{index}"], axis=0, count=3
        ).astype(np.bool_)
        assert self.poses is not None
        return Labels(
            world_from_sensor=self.poses[index],
            foreground=foreground,
            dynamic=dynamic,
            instance=instance,
            boxes=self._boxes(index),
            annotated=told,
        )

    def _boxes(self, index: int) -> tuple[Box, ...]:
        columns = [
            self._file[f"box_{what}_{index}"] for what in ("ids", "poses", "numbers", "names")
        ]
        return tuple(
            Box(
                id=int(ids[0]),
                category=str(name),
                size_lwh=(float(numbers[0]), float(numbers[1]), float(numbers[2])),
                sensor_from_object=pose,
                speed_mps=float(numbers[3]),
                dynamic=bool(ids[1]),
            )
            for ids, pose, numbers, name in zip(*columns, strict=True)
        )
