"""Open any source of frames as one lazy sequence. Read `open_sequence` first."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Box, Frame, Labels
from lidaraccum.errors import InputError, MissingInputError
from lidaraccum.io.columns import Columns, LasReference, RawVlr
from lidaraccum.io.frame_source import FrameSource, check_bin_files, frame_source
from lidaraccum.io.interpret import Occasion, frame_from_columns
from lidaraccum.io.layout_poses import sensor_poses
from lidaraccum.io.layouts import NPZ_LABELS, Layout, Source, find_layout
from lidaraccum.io.sequence_info import ReadCounts, SequenceInfo
from lidaraccum.io.settings import AUTO_POSES, InputSettings, selection
from lidaraccum.io.timing import Timing, find_timing
from lidaraccum.io.truth import label_fields, read_boxes, read_truth, rows_of_labels

__all__ = ["FileSequence", "InputSettings", "ReadCounts", "SequenceInfo", "open_sequence"]

logger = logging.getLogger(__name__)


def open_sequence(source: Source, settings: InputSettings | None = None) -> FileSequence:
    """Open frames for reading; none is read yet.

    Args:
        source: A folder, a glob, a list file (``.txt``, ``.lst``), a list of paths, or one file.
        settings: What the user says about the input.

    Raises:
        MissingInputError: Nothing is there.
        InputError: It is there but cannot be read as a sequence.
    """
    settings = settings or InputSettings()
    layout = find_layout(source, settings.format)
    if layout.bin_fields and not settings.bin_fields:
        settings = replace(settings, bin_fields=layout.bin_fields)
    check_bin_files(layout, settings)
    return FileSequence(str(source), layout, settings, frame_source(layout, settings))


class FileSequence:
    """Frames on disk, read when asked for; implements `Sequence` and `LabelledSequence`."""

    def __init__(
        self, source: str, layout: Layout, settings: InputSettings, frames: FrameSource
    ) -> None:
        self._source = source
        self._layout = layout
        self._settings = settings
        self._frames = frames
        self._chosen = range(len(frames))[selection(settings.frames)]
        self._counts: dict[int, ReadCounts] = {}
        self._rows: dict[int, NDArray[np.int64]] = {}
        self._said: set[str] = set()
        if not self._chosen:
            raise InputError(f"--frames {settings.frames} chooses none of {len(frames)} frames")

    def __len__(self) -> int:
        return len(self._chosen)

    def __getitem__(self, index: int, /) -> Frame:
        place = self._chosen[index]
        frame = frame_from_columns(self._columns(place), self._occasion(place, self._period_s))
        self._count(place, frame)
        return frame

    @property
    def name(self) -> str:
        """The folder's or file's name."""
        return self._layout.name

    @property
    def rate_hz(self) -> float:
        """Frames a second, ``--frames`` counted in."""
        return 1.0 / (self._period_s * self._chosen.step)

    @cached_property
    def poses(self) -> NDArray[np.float64] | None:
        """(T, 4, 4) world_from_sensor, only when the settings ask for poses."""
        asked = self._settings.poses
        if not asked:
            return None
        if asked != AUTO_POSES:
            return self._poses_of(Path(asked))
        if self._layout.poses_file is None:
            raise MissingInputError(f"no poses lie beside the frames of {self._source}")
        return self._poses_of(self._layout.poses_file)

    @property
    def sensor(self) -> str:
        """What took the frames, as the folder states; empty where it does not."""
        return self._layout.sensor

    @property
    def crs_wkt(self) -> str | None:
        """Coordinate reference system of the first frame as WKT, or None."""
        return self.las_reference.crs_wkt

    @property
    def crs_vlrs(self) -> tuple[RawVlr, ...]:
        """The first LAS file's records about its coordinate system, to be written back."""
        return self.las_reference.vlrs

    @cached_property
    def las_reference(self) -> LasReference:
        """What the first LAS file's coordinates and times refer to, to be written back."""
        if self._layout.format not in ("las", "laz"):
            return LasReference()
        from lidaraccum.io.las import read_reference

        return read_reference(self._layout.frames[0])

    @property
    def files(self) -> tuple[Path, ...]:
        """The frames' files, in order; one file when it holds many frames."""
        if len(self._layout.frames) != len(self._frames):
            return self._layout.frames
        return tuple(self._layout.frames[place] for place in self._chosen)

    def frame_name(self, index: int) -> str:
        """What frame ``index`` is called in messages."""
        return self._frames.label(self._chosen[index])

    @property
    def counts(self) -> ReadCounts:
        """Points of the frames read so far."""
        counts = self._counts.values()
        return ReadCounts(
            sum(c.points for c in counts),
            sum(c.dropped for c in counts),
            sum(c.no_return for c in counts),
        )

    def require_frames(self, least: int) -> None:
        """Raise InputError unless there are that many frames."""
        if len(self) >= least:
            return
        hint = ""
        if self._layout.format in ("las", "laz") and len(self._frames) == 1:
            hint = "if the file holds many frames, tell them apart with --split-by"
        raise InputError(
            f"{self._source} holds {len(self)} frame, but {least} are needed", hint=hint
        )

    @property
    def has_labels(self) -> bool:
        """Whether the truth about the points lies beside the frames."""
        return self._layout.labels is not None

    @cached_property
    def label_fields(self) -> tuple[str, ...]:
        """Which truth there is: ``instance``, ``dynamic``, ``foreground``, ``semantic``, ..."""
        folder = self._layout.labels
        if folder is None:
            return ()
        if self._layout.label_kind != NPZ_LABELS:
            return ("semantic", "instance", "dynamic", "foreground")
        return label_fields(folder / f"{self._stem(self._chosen[0])}.npz")

    def labels(self, index: int, /) -> Labels:
        """The truth about frame ``index``, row by row with its points.

        Raises:
            InputError: There is none, or it has another number of rows than the frame.
        """
        folder, place = self._layout.labels, self._chosen[index]
        if folder is None:
            raise InputError(f"{self._source} has no labels")
        pose = self._label_poses[place]
        boxes = self._boxes.get(place, ())
        labels = read_truth(folder, self._layout.label_kind, self._stem(place), pose, boxes)
        if place not in self._counts:
            self[index]
        count = self._counts[place].points
        if len(labels.foreground) != count:
            raise InputError(
                f"the labels of {self._frames.label(place)} have {len(labels.foreground)} rows, "
                f"the frame has {count}"
            )
        rows = self._rows.get(place)
        return labels if rows is None else rows_of_labels(labels, rows)

    @property
    def info(self) -> SequenceInfo:
        """What was found, in words."""
        labels = ", ".join(self.label_fields)
        return SequenceInfo(
            source=self._source,
            layout=self._layout.kind,
            format=self._layout.format,
            frames=len(self),
            files=self.files,
            rate_hz=self.rate_hz,
            rate_from=self._timing.rate_from,
            times_from=self._timing.times_from,
            poses_file=self._layout.poses_file,
            poses_used=self._settings.poses or "none: to be estimated",
            labels=f"{self._layout.label_kind}: {labels}" if labels else "",
            crs_wkt=self.crs_wkt,
            warnings=self._layout.warnings,
        )

    @cached_property
    def _timing(self) -> Timing:
        return find_timing(self._layout, self._settings, self._frames)

    @property
    def _period_s(self) -> float:
        return self._timing.period_s

    def _occasion(self, place: int, period_s: float) -> Occasion:
        stamps = self._timing.stamps
        name = self._frames.label(place)
        if stamps is None:
            return Occasion(name, place * period_s, period_s)
        return Occasion(name, float(stamps[place]), period_s, exact=True)

    def _columns(self, place: int) -> Columns:
        columns = self._frames.columns(place)
        for said in columns.warnings:
            self._say_once(said.partition(": ")[2] or said, said)
        if not columns.standard:
            return columns
        used = {
            name: values
            for name, values in columns.attributes.items()
            if name not in columns.standard or name in self._used_standard or values.any()
        }
        return replace(columns, attributes=used)

    @cached_property
    def _used_standard(self) -> frozenset[str]:
        """Dimensions every LAS file has that this one uses, judged by the first and last frame."""
        used: set[str] = set()
        for place in {self._chosen[0], self._chosen[-1]}:
            columns = self._frames.columns(place)
            used |= {n for n in columns.standard if columns.attributes[n].any()}
        return frozenset(used)

    def _count(self, place: int, frame: Frame) -> None:
        dropped = frame.row_count - len(frame)
        missing = int(len(frame) - np.count_nonzero(frame.returned))
        self._counts[place] = ReadCounts(frame.row_count, dropped, missing)
        if frame.rows is not None:
            self._rows[place] = frame.rows
        if dropped:
            self._say_once("dropped", f"{frame.name}: {dropped} non-finite points dropped")
        if missing:
            self._say_once("missing", f"{frame.name}: {missing} points without return at 0, 0, 0")

    def _say_once(self, key: str, sentence: str) -> None:
        if key not in self._said:
            self._said.add(key)
            logger.warning("%s (said once a sequence)", sentence)

    def _stem(self, place: int) -> str:
        name = self._layout.frames[place].name
        return name[: -len(self._layout.format) - 1]

    @cached_property
    def _boxes(self) -> dict[int, tuple[Box, ...]]:
        return read_boxes(self._layout.boxes_file) if self._layout.boxes_file else {}

    @cached_property
    def _label_poses(self) -> NDArray[np.float64]:
        """Poses (T, 4, 4) of all frames on disk, for the labels: where none are, the identity."""
        count = len(self._frames)
        if self._layout.poses_file is None:
            return np.tile(np.eye(4), (count, 1, 1))
        poses = self._sensor_poses(self._layout.poses_file)
        if len(poses) != count:
            raise InputError(
                f"{self._layout.poses_file} holds {len(poses)} poses for {count} frames"
            )
        return poses

    def _sensor_poses(self, path: Path) -> NDArray[np.float64]:
        return sensor_poses(path, self._layout, self._timing, len(self._frames))

    def _poses_of(self, path: Path) -> NDArray[np.float64]:
        """Poses (T, 4, 4) of the chosen frames."""
        poses = self._sensor_poses(path)
        if len(poses) == len(self._frames):
            return poses[list(self._chosen)]
        if len(poses) == len(self):
            return poses
        raise InputError(f"{path} holds {len(poses)} poses for {len(self._frames)} frames")
