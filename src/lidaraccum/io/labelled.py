"""Labelled sequences out: what `open_sequence` reads back, frame by frame the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Box, Frame, Labels
from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.errors import SettingsError
from lidaraccum.io.atomic import atomic, write_json, write_text
from lidaraccum.io.columns import LasReference
from lidaraccum.io.point_time import find_time
from lidaraccum.io.poses import kitti_text

FRAME_FORMATS = ("ply", "laz", "las", "bin")
PLY_TYPES = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}


@dataclass(frozen=True)
class LabelledSettings:
    """How to write a labelled sequence.

    Attributes:
        format: Of the frames: ``ply`` keeps every bit; ``laz`` and ``las`` keep 1 mm and 16 bits
            of intensity; ``bin`` makes every column float32.
        sensor: What took it, for ``meta.json``.
        licence: Of the data, for ``meta.json``.
        notes: Further entries of ``meta.json``.
        overwrite: Replace an existing folder.
    """

    format: str = "ply"
    sensor: str = ""
    licence: str = ""
    notes: Mapping[str, Any] = field(default_factory=dict)
    overwrite: bool = False

    def __post_init__(self) -> None:
        if self.format not in FRAME_FORMATS:
            raise SettingsError(
                f"frames cannot be written as {self.format}",
                hint=f"known: {', '.join(FRAME_FORMATS)}",
            )


def write_labelled_sequence(
    directory: Path | str, sequence: LabelledSequence, settings: LabelledSettings | None = None
) -> None:
    """Write frames, labels, poses, boxes and meta.json into a new folder, whole or not at all.

    Frames are taken one by one. A frame's ``time_offset`` is written as column ``t``, unless one
    of its attributes says it already.

    Raises:
        OutputExistsError: The folder exists and may not be overwritten.
        OutputError: The system refuses.
    """
    settings = settings or LabelledSettings()
    with atomic(Path(directory), overwrite=settings.overwrite) as folder:
        (folder / "frames").mkdir(parents=True)
        (folder / "labels").mkdir()
        poses, boxes, times = [], [], []
        fields: tuple[str, ...] = ()
        for index in range(len(sequence)):
            frame, labels = sequence[index], sequence.labels(index)
            columns = columns_of(frame, 1.0 / sequence.rate_hz)
            fields = fields or tuple(columns)
            path = folder / "frames" / f"{index:06d}.{settings.format}"
            write_frame(path, frame, columns, fields)
            write_labels(folder / "labels" / f"{index:06d}.npz", labels)
            poses.append(labels.world_from_sensor)
            times.append(float(frame.stamp))
            boxes.append(boxes_entry(index, frame.stamp, labels.boxes))
        write_text(folder / "poses.txt", kitti_text(np.stack(poses)))
        write_json(folder / "boxes.json", boxes)
        write_json(folder / "meta.json", meta_of(sequence, settings, times, fields))


def columns_of(frame: Frame, period_s: float) -> dict[str, NDArray[Any]]:
    """Every column (N,) of a frame besides its position."""
    columns: dict[str, NDArray[Any]] = {}
    if frame.intensity is not None:
        columns["intensity"] = frame.intensity
    if frame.ring is not None:
        columns["ring"] = frame.ring
    columns |= frame.attributes
    if frame.time_offset is not None:
        known = find_time(frame.attributes, frame.returned, frame.stamp, period_s, exact=True)
        if known.offset is None or not np.allclose(known.offset, frame.time_offset, atol=1e-6):
            columns["time_offset" if "t" in columns else "t"] = frame.time_offset
    return columns


def write_frame(
    path: Path, frame: Frame, columns: Mapping[str, NDArray[Any]], fields: tuple[str, ...]
) -> None:
    """Write one frame; a ``.bin`` holds the named fields, NaN where the frame lacks one."""
    if path.suffix == ".bin":
        missing = np.full(len(frame), np.nan)
        others = [columns.get(name, missing) for name in fields]
        table = np.column_stack([frame.points + frame.origin, *others]).astype("<f4")
        table.tofile(path)
    elif path.suffix == ".ply":
        write_ply_frame(path, frame, columns)
    else:
        write_las_frame(path, frame, columns)


def write_ply_frame(path: Path, frame: Frame, columns: Mapping[str, NDArray[Any]]) -> None:
    """Binary PLY, each column in its own type; positions are double when georeferenced."""
    if frame.origin.any():
        positions: NDArray[Any] = frame.points.astype(np.float64) + frame.origin
    else:
        positions = frame.points
    plain = {n: v.astype(np.uint8) if v.dtype.kind == "b" else v for n, v in columns.items()}
    dtype = np.dtype(
        [(axis, positions.dtype.newbyteorder("<")) for axis in "xyz"]
        + [("_".join(name.split()), stored_type(v.dtype)) for name, v in plain.items()]
    )
    records = np.empty(len(frame), dtype)
    for name, values in zip(dtype.names or (), [*positions.T, *plain.values()], strict=True):
        records[name] = values
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(frame)}"]
    lines += [f"property {PLY_TYPES[dtype[n].str[1:]]} {n}" for n in dtype.names or ()]
    with path.open("wb") as file:
        file.write(("\n".join([*lines, "end_header"]) + "\n").encode())
        file.write(records.tobytes())


def stored_type(kind: np.dtype[Any]) -> np.dtype[Any]:
    """PLY's type for a column; 64-bit integers become double, half floats float."""
    if kind.str[1:] in PLY_TYPES:
        return kind.newbyteorder("<")
    return np.dtype("<f4") if kind == np.float16 else np.dtype("<f8")


def write_las_frame(path: Path, frame: Frame, columns: Mapping[str, NDArray[Any]]) -> None:
    """LAS 1.4 without our own fields; ``gps_time`` is the stamp plus the time of the point."""
    from lidaraccum.io.cloud_schema import Chunk, Schema
    from lidaraccum.io.write_las import LasEncoder, LasTarget

    time = np.zeros(len(frame)) if frame.time_offset is None else frame.time_offset
    chunk = Chunk(frame.points.astype(np.float64) + frame.origin, {"time": time}, dict(columns))
    schema = Schema({name: values.dtype for name, values in columns.items()}, frame.stamp)
    target = LasTarget(path, path.suffix == ".laz", LasReference(), own_fields=False)
    encoder = LasEncoder(target, chunk, schema)
    encoder.write(chunk)
    encoder.finish()


def write_labels(path: Path, labels: Labels) -> None:
    """The truth about each point, compressed."""
    arrays: dict[str, Any] = {
        "instance": labels.instance.astype(np.int32),
        "dynamic": labels.dynamic,
        "foreground": labels.foreground,
    }
    if labels.annotated is not None:
        arrays["annotated"] = labels.annotated
    if labels.semantic is not None:
        arrays["semantic"] = labels.semantic
    if labels.points_at_stamp is not None:
        arrays["points_at_stamp"] = np.asarray(labels.points_at_stamp, np.float32)
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def boxes_entry(index: int, stamp: float, boxes: tuple[Box, ...]) -> dict[str, Any]:
    """One frame's entry of boxes.json."""
    return {
        "frame": index,
        "time": float(stamp),
        "boxes": [
            {
                "id": int(box.id),
                "category": box.category,
                "size_lwh": [float(size) for size in box.size_lwh],
                "pose": np.asarray(box.sensor_from_object, dtype=np.float64).tolist(),
                "speed_mps": float(box.speed_mps),
                "dynamic": bool(box.dynamic),
            }
            for box in boxes
        ],
    }


def meta_of(
    sequence: LabelledSequence,
    settings: LabelledSettings,
    times: list[float],
    fields: tuple[str, ...],
) -> dict[str, Any]:
    """The content of meta.json."""
    meta: dict[str, Any] = {
        "dataset": sequence.name,
        "sensor": settings.sensor,
        "licence": settings.licence,
        "hz": float(sequence.rate_hz),
        "frames": len(times),
        "times": times,
        **settings.notes,
    }
    if settings.format == "bin":
        meta["bin_fields"] = ["x", "y", "z", *fields]
    return meta
