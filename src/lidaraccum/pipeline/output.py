"""Everything that a run leaves on disk: the cloud, and what lies beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from lidaraccum.data.accumulation import AccumulatedFrame
from lidaraccum.errors import OutputExistsError, SettingsError
from lidaraccum.io.atomic import atomic, check_free, json_text, write_text
from lidaraccum.io.label_files import write_label_file
from lidaraccum.io.poses import kitti_text, tum_text
from lidaraccum.io.sequences import FileSequence
from lidaraccum.io.writers import WriterSettings, check_suffix, open_writer
from lidaraccum.pipeline.accumulator import AccumulateSettings, Accumulator
from lidaraccum.pipeline.object_clouds import ObjectClouds
from lidaraccum.pipeline.report import AccumulationReport
from lidaraccum.pipeline.sidecars import objects_json, report_of

Watch = Callable[[Iterable[AccumulatedFrame]], Iterator[AccumulatedFrame]]


class FrameSink(Protocol):
    """Takes each placed frame, all its points, in order."""

    def write(self, frame: AccumulatedFrame) -> None:
        """Take one frame."""


@dataclass(frozen=True)
class OutputSettings:
    """What to write and where.

    Attributes:
        path: The cloud; its suffix says the format.
        overwrite: Replace what exists.
        sidecars: Write poses, objects and report beside the cloud.
        labels_dir: Folder for SemanticKITTI ``.label`` files, or None.
        objects_dir: Folder for each object's own cloud, or None.
        settings: What was asked for, flat, for the report.
    """

    path: Path
    overwrite: bool = False
    sidecars: bool = True
    labels_dir: Path | None = None
    objects_dir: Path | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def poses_path(self) -> Path:
        """KITTI rows, reference_from_frame."""
        return self.path.with_suffix(".poses.txt")

    @property
    def tum_path(self) -> Path:
        """The same poses with stamps."""
        return self.path.with_suffix(".tum")

    @property
    def objects_path(self) -> Path:
        """What was found to be an object, and its motions."""
        return self.path.with_suffix(".objects.json")

    @property
    def report_path(self) -> Path:
        """Settings, versions, times, counts, warnings."""
        return self.path.with_suffix(".report.json")


class LabelFiles:
    """A ``.label`` file for each frame, called like the frame's own file."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._folder.mkdir(parents=True)

    def write(self, frame: AccumulatedFrame) -> None:
        """Write the frame's file; frames of one name are told apart by their index."""
        stem = frame.name.removesuffix(".pcd.bin")
        stem = Path(stem).stem if stem == frame.name else stem
        path = self._folder / f"{stem or frame.index}.label"
        if path.exists():
            path = self._folder / f"{frame.index:06d}.label"
        write_label_file(path, frame)


def planned_outputs(output: OutputSettings) -> list[Path]:
    """Every file and folder that a run with these settings writes."""
    paths = [output.path]
    if output.sidecars:
        paths += [output.poses_path, output.tum_path, output.objects_path, output.report_path]
    return paths + [path for path in (output.labels_dir, output.objects_dir) if path is not None]


def check_outputs(output: OutputSettings) -> None:
    """Refuse what cannot be written before anything is read.

    Raises:
        SettingsError: No cloud format has this suffix.
        OutputExistsError: Something is there already.
    """
    check_suffix(output.path)
    planned = [path.resolve() for path in planned_outputs(output)]
    if len(set(planned)) < len(planned):
        raise SettingsError("two outputs have the same name", hint="each needs its own")
    for path in planned_outputs(output):
        if path not in (output.labels_dir, output.objects_dir):
            check_free(path, output.overwrite)
    if output.labels_dir is not None:
        _check_folder(output.labels_dir, ".label", overwrite=output.overwrite)
    if output.objects_dir is not None:
        _check_folder(output.objects_dir, output.path.suffix.lower(), overwrite=output.overwrite)


def check_inputs_stay(sequence: FileSequence, output: OutputSettings) -> None:
    """Refuse to write over what is read; an earlier output among the frames is found here too.

    Raises:
        SettingsError: An output is one of the inputs.
    """
    inputs = {path.resolve() for path in sequence.files}
    for path in planned_outputs(output):
        if path.resolve() in inputs:
            raise SettingsError(
                f"{path} is one of the input frames", hint="write the output into another folder"
            )


def _check_folder(folder: Path, suffix: str, *, overwrite: bool) -> None:
    """A folder is replaced as a whole, so it may hold nothing but an earlier run's files."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise OutputExistsError(f"{folder} is no folder")
    present = sorted(path.name for path in folder.iterdir())
    if present and not overwrite:
        raise OutputExistsError(f"{folder} is not empty", hint="--overwrite replaces it")
    foreign = [name for name in present if not name.endswith(suffix)]
    if foreign:
        raise OutputExistsError(
            f"{folder} holds more than {suffix} files, such as {foreign[0]}",
            hint="a folder of its own is needed, for it is replaced as a whole",
        )


def accumulate_to_files(
    sequence: FileSequence,
    settings: AccumulateSettings,
    output: OutputSettings,
    watch: Watch = iter,
    processes: int = 1,
) -> AccumulationReport:
    """Put a sequence into one cloud on disk, points going out as frames come in.

    Args:
        sequence: What to read.
        settings: How the cloud comes about.
        output: What to write.
        watch: Sees each frame go by, for a progress bar.
        processes: 1 or 2, as `Accumulator` takes them.

    Raises:
        LidarAccumError: Nothing is left under a final name then.
    """
    check_outputs(output)
    check_inputs_stay(sequence, output)
    sequence.require_frames(2)
    accumulator = Accumulator(sequence, settings, processes=processes)
    cloud_settings = WriterSettings(
        overwrite=output.overwrite,
        crs_wkt=sequence.crs_wkt,
        vlrs=sequence.crs_vlrs,
        standard_gps_time=sequence.las_reference.standard_gps_time,
    )
    poses, stamps = [], []
    with ExitStack() as stack:
        cloud = stack.enter_context(open_writer(output.path, cloud_settings))
        sinks: list[FrameSink] = []
        if output.labels_dir is not None:
            folder = stack.enter_context(atomic(output.labels_dir, overwrite=True))
            sinks.append(LabelFiles(folder))
        if output.objects_dir is not None:
            folder = stack.enter_context(atomic(output.objects_dir, overwrite=True))
            clouds = ObjectClouds(folder, output.path.suffix.lower(), cloud_settings)
            sinks.append(stack.enter_context(clouds))
        for frame in watch(accumulator.frames()):
            wanted = accumulator.select(frame)
            with accumulator.clock.stage("write"):
                cloud.write(wanted)
                for sink in sinks:
                    sink.write(frame)
            poses.append(frame.reference_from_sensor)
            stamps.append(frame.stamp)
        report = report_of(sequence, accumulator, output.settings)
        if output.sidecars:
            # All texts are made before the first is written: what fails here leaves none.
            texts = {
                output.poses_path: kitti_text(np.stack(poses)),
                output.tum_path: tum_text(np.stack(poses), np.array(stamps)),
                output.objects_path: json_text(objects_json(accumulator.objects())),
                output.report_path: json_text(asdict(report)),
            }
            cloud.close()
            for path, text in texts.items():
                write_text(path, text, overwrite=output.overwrite)
    return report
