"""The JSON tables of nuScenes v1.0, as far as LIDAR_TOP and the boxes need them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from lidaraccum.errors import InputError, MissingInputError, SettingsError
from lidaraccum.io.driving.tables import read_records

CHANNEL = "LIDAR_TOP"


@dataclass(frozen=True)
class SceneRecord:
    """A row of scene.json."""

    token: str
    name: str


@dataclass(frozen=True)
class SampleRecord:
    """A row of sample.json."""

    token: str
    scene_token: str


@dataclass(frozen=True)
class SensorRecord:
    """A row of sensor.json."""

    token: str
    channel: str


@dataclass(frozen=True)
class MountRecord:
    """A row of calibrated_sensor.json."""

    token: str
    sensor_token: str
    translation: list[float]
    rotation: list[float]


@dataclass(frozen=True)
class SweepRecord:
    """A row of sample_data.json."""

    sample_token: str
    ego_pose_token: str
    calibrated_sensor_token: str
    filename: str
    timestamp: int
    is_key_frame: bool


@dataclass(frozen=True)
class PoseRecord:
    """A row of ego_pose.json."""

    token: str
    translation: list[float]
    rotation: list[float]


@dataclass(frozen=True)
class BoxRecord:
    """A row of sample_annotation.json."""

    sample_token: str
    instance_token: str
    translation: list[float]
    size: list[float]
    rotation: list[float]


@dataclass(frozen=True)
class InstanceRecord:
    """A row of instance.json."""

    token: str
    category_token: str


@dataclass(frozen=True)
class CategoryRecord:
    """A row of category.json."""

    token: str
    name: str


class NuScenesTables:
    """The tables of one version, each read when first asked for.

    Args:
        folder: Where the tables lie: v1.0-mini, v1.0-trainval, ...
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @cached_property
    def scenes(self) -> list[SceneRecord]:
        """All scenes."""
        return read_records(self._folder / "scene.json", SceneRecord)

    @cached_property
    def mounts(self) -> dict[str, MountRecord]:
        """Mounts of LIDAR_TOP, by token."""
        sensors = read_records(self._folder / "sensor.json", SensorRecord)
        tops = {sensor.token for sensor in sensors if sensor.channel == CHANNEL}
        if not tops:
            raise InputError(f"{self._folder / 'sensor.json'} has no sensor {CHANNEL}")
        mounts = read_records(
            self._folder / "calibrated_sensor.json",
            MountRecord,
            lambda mount: mount.sensor_token in tops,
        )
        return {mount.token: mount for mount in mounts}

    @cached_property
    def sweeps(self) -> dict[str, list[SweepRecord]]:
        """Sweeps of each scene, by its token, in order."""
        scene_of = {
            sample.token: sample.scene_token
            for sample in read_records(self._folder / "sample.json", SampleRecord)
        }
        sweeps = read_records(
            self._folder / "sample_data.json",
            SweepRecord,
            lambda sweep: sweep.calibrated_sensor_token in self.mounts,
        )
        by_scene: dict[str, list[SweepRecord]] = {}
        for sweep in sorted(sweeps, key=lambda one: one.timestamp):
            by_scene.setdefault(scene_of.get(sweep.sample_token, ""), []).append(sweep)
        return by_scene

    @cached_property
    def egos(self) -> dict[str, PoseRecord]:
        """Poses of the car at the sweeps, by token."""
        needed = {sweep.ego_pose_token for sweeps in self.sweeps.values() for sweep in sweeps}
        poses = read_records(
            self._folder / "ego_pose.json", PoseRecord, lambda pose: pose.token in needed
        )
        return {pose.token: pose for pose in poses}

    @cached_property
    def drawn(self) -> dict[str, list[BoxRecord]]:
        """Boxes of each sample, by its token."""
        by_sample: dict[str, list[BoxRecord]] = {}
        for box in read_records(self._folder / "sample_annotation.json", BoxRecord):
            by_sample.setdefault(box.sample_token, []).append(box)
        return by_sample

    @cached_property
    def words(self) -> dict[str, str]:
        """Name of each instance's category, by the instance's token."""
        categories = read_records(self._folder / "category.json", CategoryRecord)
        names = {category.token: category.name for category in categories}
        instances = read_records(self._folder / "instance.json", InstanceRecord)
        return {one.token: names.get(one.category_token, "") for one in instances}


def tables_folder(root: Path, version: str | None) -> Path:
    """The folder of a version's tables; the only one there is, where none is named.

    Raises:
        MissingInputError: There is none, or not of that version.
        SettingsError: There are several.
    """
    found = sorted(path.parent.name for path in root.glob("*/scene.json"))
    if not found:
        raise MissingInputError(
            f"{root} holds no nuScenes tables",
            hint="SRC is the folder that holds v1.0-mini (or another version), samples and sweeps",
        )
    if version is None and len(found) > 1:
        raise SettingsError(
            f"{root} holds several versions", hint=f"--version {' or '.join(found)}"
        )
    if version is not None and version not in found:
        raise MissingInputError(
            f"{root} holds no tables of version {version}", hint=f"it has {', '.join(found)}"
        )
    return root / (version or found[0])
