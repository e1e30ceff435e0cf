"""How a folder is laid out: which files are frames, and what lies beside them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError, MissingInputError
from lidaraccum.io.columns import readable
from lidaraccum.io.listing import (
    FORMATS,
    GLOB_MARKS,
    LIST_SUFFIXES,
    checked_paths,
    frames_in,
    frames_of_glob,
    frames_of_list,
    natural_key,
    of_one_format,
)
from lidaraccum.io.stamps import read_times, stamps_of_names

NPZ_LABELS, SEMANTIC_KITTI_LABELS = "npz", "label"


@dataclass(frozen=True, eq=False)
class Layout:
    """The files of a sequence.

    Attributes:
        kind: What the folder was recognised as, in words.
        name: What the sequence is called.
        frames: The frames' files, in order.
        format: Their format.
        stamps: (T,) seconds, or None when nothing beside the points tells.
        stamps_from: Where they were found, in words.
        rate_hz: Frames a second that the folder states, or None.
        poses_file: Poses found beside the frames, or None.
        calibration: KITTI's calib.txt when those poses are the camera's, or None.
        labels: Folder with the truth about the points, or None.
        label_kind: `NPZ_LABELS` or `SEMANTIC_KITTI_LABELS`, or empty.
        bin_fields: Names of the fields of ``.bin`` frames that the folder states, or none.
        boxes_file: Tracked boxes, or None.
        sensor: What took the frames, as the folder states; empty where it does not.
        warnings: What looks odd, in words.
    """

    kind: str
    name: str
    frames: tuple[Path, ...]
    format: str = ""
    stamps: NDArray[np.float64] | None = None
    stamps_from: str = ""
    rate_hz: float | None = None
    poses_file: Path | None = None
    calibration: Path | None = None
    labels: Path | None = None
    label_kind: str = ""
    bin_fields: tuple[str, ...] = ()
    boxes_file: Path | None = None
    sensor: str = ""
    warnings: tuple[str, ...] = ()


Source = str | Path | Sequence[str | Path]


def find_layout(source: Source, wanted: str | None = None) -> Layout:
    """Recognise what a source is: a folder, a glob, a list file, a list of paths, or one file.

    Raises:
        MissingInputError: Nothing is there.
        InputError: Formats are mixed, or a file beside the frames cannot be read.
    """
    layout = recognise(source)
    if not layout.frames:
        raise nothing_found(source)
    frames, form = of_one_format(layout.frames, wanted, str(source))
    if layout.stamps is not None and len(frames) != len(layout.frames):
        kept = [layout.frames.index(path) for path in frames]
        layout = replace(layout, stamps=layout.stamps[kept])
    layout = replace(layout, frames=frames, format=form)
    if layout.stamps is None:
        stamps = stamps_of_names(frames)
        if stamps is not None:
            layout = replace(layout, stamps=stamps, stamps_from="the frames' names")
    return checked(layout)


def nothing_found(source: Source) -> MissingInputError:
    """The error for a source without frames; it names folders inside that hold some."""
    hint = f"looked for {', '.join(sorted(FORMATS))} files"
    if isinstance(source, str | Path) and Path(source).is_dir():
        folders = sorted(path for path in Path(source).iterdir() if path.is_dir())
        full = [path.name for path in folders[:100] if layout_of_folder(path).frames]
        if full:
            hint = f"its folder {full[0]} holds frames"
    return MissingInputError(f"{source} holds no frame", hint=hint)


def recognise(source: Source) -> Layout:
    """The layout before formats are looked at."""
    if not isinstance(source, str | Path):
        paths = checked_paths(source)
        return Layout("list of paths", paths[0].stem if paths else "list", paths)
    path = Path(source)
    if not str(source):
        raise MissingInputError("no source was named")
    if path.is_dir():
        return layout_of_folder(path)
    if path.exists():
        if path.suffix.lower() in LIST_SUFFIXES:
            return Layout("list file", path.stem, frames_of_list(path))
        return Layout("single file", path.stem, checked_paths([path]))
    if GLOB_MARKS & set(str(source)):
        frames = frames_of_glob(str(source))
        return Layout("glob", frames[0].parent.name or "glob", frames)
    raise MissingInputError(f"{path} does not exist")


def layout_of_folder(folder: Path) -> Layout:
    """The layout of a directory, by the first convention that fits."""
    for subfolder, reader in (
        ("frames", labelled_layout),
        ("velodyne", kitti_odometry_layout),
        ("velodyne_points/data", kitti_raw_layout),
        ("sweeps/LIDAR_TOP", nuscenes_layout),
        ("samples/LIDAR_TOP", nuscenes_layout),
    ):
        if (folder / subfolder).is_dir():
            return reader(folder)
    return flat_layout(folder)


def flat_layout(folder: Path) -> Layout:
    """Frames right in the folder; times and poses may lie among them."""
    times = first_file(folder, "times.txt", "timestamps.txt")
    return Layout(
        "flat folder",
        folder.resolve().name,
        frames_in(folder),
        stamps=read_times(times) if times else None,
        stamps_from=times.name if times else "",
        poses_file=first_file(folder, "poses.txt", "poses.tum"),
    )


def labelled_layout(folder: Path) -> Layout:
    """Our own: frames/, labels/NNNNNN.npz, poses.txt, boxes.json, meta.json."""
    meta = read_meta(folder / "meta.json")
    times = first_file(folder, "times.txt", "timestamps.txt")
    stamps = numbers_of_meta(folder / "meta.json", meta, "times")
    rate_hz = numbers_of_meta(folder / "meta.json", meta, "hz")
    stamps_from = "meta.json" if stamps is not None else ""
    if times and stamps is None:
        stamps, stamps_from = read_times(times), times.name
    labels = folder / "labels"
    has_labels = labels.is_dir() and any(labels.glob("*.npz"))
    return Layout(
        "labelled sequence" if has_labels else "frames folder",
        folder.resolve().name,
        frames_in(folder / "frames"),
        stamps=stamps,
        stamps_from=stamps_from,
        rate_hz=None if rate_hz is None else float(rate_hz[0]),
        poses_file=first_file(folder, "poses.txt", "poses.tum"),
        labels=labels if has_labels else None,
        label_kind=NPZ_LABELS if has_labels else "",
        bin_fields=stated_fields(folder / "meta.json", meta),
        boxes_file=first_file(folder, "boxes.json"),
        sensor=str(meta.get("sensor", "")),
    )


def stated_fields(path: Path, meta: dict[str, Any]) -> tuple[str, ...]:
    """Names of the fields of ``.bin`` frames that meta.json states, or none.

    Raises:
        InputError: It states something else.
    """
    names = meta.get("bin_fields", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"bin_fields in {path} must be a list of names, not {names!r}")
    if names and not {"x", "y", "z"} <= set(names):
        raise InputError(f"bin_fields in {path} lack x, y or z")
    return tuple(names)


def kitti_odometry_layout(folder: Path) -> Layout:
    """KITTI odometry and SemanticKITTI: velodyne/, times.txt, poses.txt, calib.txt, labels/."""
    name = folder.resolve().name
    times = first_file(folder, "times.txt")
    labels = folder / "labels"
    has_labels = labels.is_dir() and any(labels.glob("*.label"))
    poses = first_file(folder, "poses.txt", f"../../poses/{name}.txt")
    calibration = first_file(folder, "calib.txt")
    said = f"{poses.name if poses else ''} is taken to hold poses of the sensor: no calib.txt"
    return Layout(
        "SemanticKITTI sequence" if has_labels else "KITTI odometry sequence",
        name,
        frames_in(folder / "velodyne"),
        stamps=read_times(times) if times else None,
        stamps_from="times.txt" if times else "",
        poses_file=poses,
        calibration=calibration,
        labels=labels if has_labels else None,
        label_kind=SEMANTIC_KITTI_LABELS if has_labels else "",
        warnings=(said,) if poses and not calibration else (),
    )


def kitti_raw_layout(folder: Path) -> Layout:
    """KITTI raw drive: velodyne_points/data/, velodyne_points/timestamps.txt."""
    times = first_file(folder / "velodyne_points", "timestamps.txt")
    times = times or first_file(folder, "timestamps.txt", "times.txt")
    return Layout(
        "KITTI raw drive",
        folder.resolve().name,
        frames_in(folder / "velodyne_points" / "data"),
        stamps=read_times(times) if times else None,
        stamps_from=times.name if times else "",
        poses_file=first_file(folder, "poses.txt"),
    )


def nuscenes_layout(folder: Path) -> Layout:
    """nuScenes: samples/LIDAR_TOP and sweeps/LIDAR_TOP are one drive, ordered by stamp."""
    folders = [folder / "samples" / "LIDAR_TOP", folder / "sweeps" / "LIDAR_TOP"]
    frames = [path for place in folders if place.is_dir() for path in frames_in(place)]
    stamps = stamps_of_names(frames)
    if stamps is not None:
        frames = [frames[i] for i in np.argsort(stamps, kind="stable")]
    else:
        frames.sort(key=natural_key)
    return Layout("nuScenes sweeps", folder.resolve().name, tuple(frames))


def first_file(folder: Path, *names: str) -> Path | None:
    """The first of the names that is a file in the folder."""
    return next((folder / name for name in names if (folder / name).is_file()), None)


def read_meta(path: Path) -> dict[str, Any]:
    """What meta.json says; empty when there is none."""
    if not path.is_file():
        return {}
    with readable(path):
        try:
            meta = json.loads(path.read_text())
        except ValueError as error:
            raise InputError(f"{path} is not JSON: {error}") from error
    if not isinstance(meta, dict):
        raise InputError(f"{path} is not a JSON object")
    return meta


def numbers_of_meta(path: Path, meta: dict[str, Any], key: str) -> NDArray[np.float64] | None:
    """An entry's numbers (M,), or None when meta.json does not have it.

    Raises:
        InputError: They are no numbers, or the rate is not positive.
    """
    if key not in meta:
        return None
    try:
        numbers = np.atleast_1d(np.array(meta[key], dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: {key} holds something that is no number") from error
    if numbers.ndim != 1 or (key == "hz" and not (len(numbers) == 1 and numbers[0] > 0)):
        raise InputError(f"{path}: {key} makes no sense: {meta[key]!r:.50}")
    return numbers


def checked(layout: Layout) -> Layout:
    """The layout with its stamps checked against its frames."""
    stamps, count = layout.stamps, len(layout.frames)
    if stamps is None:
        return layout
    if len(stamps) != count:
        said = f"{layout.stamps_from} holds {len(stamps)} times for {count} frames: not used"
        return replace(layout, stamps=None, stamps_from="", warnings=(*layout.warnings, said))
    steps = np.diff(stamps)
    if count > 1 and not (np.isfinite(steps).all() and (steps > 0).all()):
        said = f"the times of {layout.stamps_from} do not increase: not used"
        return replace(layout, stamps=None, stamps_from="", warnings=(*layout.warnings, said))
    usual = float(np.median(steps)) if count > 1 else 0.0
    jumps = np.flatnonzero(steps > max(5.0, 20 * usual))
    if len(jumps):
        said = (
            f"the times jump by {steps[jumps[0]]:.1f} s after frame {jumps[0]} "
            f"({len(jumps)} such jumps): several drives in one folder?"
        )
        return replace(layout, warnings=(*layout.warnings, said))
    return layout
