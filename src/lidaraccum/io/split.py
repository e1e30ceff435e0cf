"""One LAS file that holds many frames, told apart by one of its dimensions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError, SettingsError
from lidaraccum.io.columns import Columns, readable
from lidaraccum.io.las import DAMAGE, check_header, columns_of_points, unreadable

POINTS_AT_A_TIME = 1_000_000
TIME_BIN_S = 1e-3
GAP_OF_PERIOD = 0.1
LONGEST_OF_PERIOD = 1.5


@dataclass(frozen=True, eq=False)
class Runs:
    """Which stretches of the file belong to which frame.

    Attributes:
        frame: (R,) index of the frame of each stretch.
        start: (R,) first row.
        stop: (R,) row after the last.
    """

    frame: NDArray[np.int64]
    start: NDArray[np.int64]
    stop: NDArray[np.int64]


class SplitLas:
    """Frames of one LAS or LAZ file.

    Opening reads the file once, piece by piece, and remembers which stretches of rows belong to
    which frame; a frame is then read by seeking. Memory grows with the number of stretches, which
    is the number of frames when the file is in their order.
    """

    def __init__(self, path: Path, dimension: str, period_s: float) -> None:
        self._path = path
        check_header(path)
        self._names, self._runs = index_frames(path, dimension, period_s)

    def __len__(self) -> int:
        return len(self._names)

    def label(self, index: int) -> str:
        """The file's name and what tells the frame."""
        return f"{self._path.name} {self._names[index]}"

    def columns(self, index: int) -> Columns:
        """The rows of frame ``index``, in file order."""
        mine = np.flatnonzero(self._runs.frame == index)
        starts, stops = self._runs.start[mine], self._runs.stop[mine]
        first, last = int(starts[0]), int(stops[-1])
        with readable(self._path), opened(self._path) as reader:
            pieces = []
            for begin in range(first, last, POINTS_AT_A_TIME):
                end = min(begin + POINTS_AT_A_TIME, last)
                here = (stops > begin) & (starts < end)
                if not here.any():
                    continue
                reader.seek(begin)
                keep = rows_kept(starts[here], stops[here], begin, end)
                pieces.append(
                    columns_of_points(reader.read_points(end - begin)[keep], reader.header)
                )
        return joined(pieces)


def opened(path: Path) -> Any:
    """A laspy reader; its complaints become `InputError`."""
    try:
        return laspy.open(path)
    except DAMAGE as error:
        raise unreadable(path, error) from error


def rows_kept(
    starts: NDArray[np.int64], stops: NDArray[np.int64], begin: int, end: int
) -> NDArray[np.bool_]:
    """Which rows of ``begin`` to ``end`` lie in one of the stretches."""
    edges = np.zeros(end - begin + 1, np.int64)
    np.add.at(edges, np.clip(starts - begin, 0, end - begin), 1)
    np.add.at(edges, np.clip(stops - begin, 0, end - begin), -1)
    return np.cumsum(edges[:-1]) > 0


def joined(pieces: list[Columns]) -> Columns:
    """The pieces of one frame as one."""
    if len(pieces) == 1:
        return pieces[0]
    first = pieces[0]
    return Columns(
        np.concatenate([piece.xyz for piece in pieces]),
        {n: np.concatenate([p.attributes[n] for p in pieces]) for n in first.attributes},
        first.crs_wkt,
        first.vlrs,
        first.standard,
    )


def index_frames(path: Path, dimension: str, period_s: float) -> tuple[tuple[str, ...], Runs]:
    """Names of the frames, and which stretches of the file belong to each.

    Raises:
        SettingsError: The file has no such dimension.
        InputError: It cannot be read through, or its gps_time does not vary.
    """
    if dimension == "gps_time":
        edges = frame_edges(path, period_s)
        names = tuple(f"gps_time {edge:.6f}" for edge in edges)
        runs = find_runs(path, dimension, lambda v: np.searchsorted(edges, v, side="right") - 1)
        return names, runs
    values = distinct_values(path, dimension)
    names = tuple(f"{dimension} {value}" for value in values)
    return names, find_runs(path, dimension, lambda v: np.searchsorted(values, v))


def pieces_of(path: Path, dimension: str) -> Iterator[NDArray[Any]]:
    """One dimension of the file, piece by piece."""
    with readable(path), opened(path) as reader:
        known = list(reader.header.point_format.dimension_names)
        if dimension not in known:
            raise SettingsError(
                f"{path} has no dimension {dimension} to split by",
                hint=f"it has {', '.join(known)}",
            )
        try:
            for points in reader.chunk_iterator(POINTS_AT_A_TIME):
                yield np.asarray(points[dimension])
        except DAMAGE as error:
            raise unreadable(path, error) from error


def distinct_values(path: Path, dimension: str) -> NDArray[Any]:
    """The dimension's values, sorted, each once."""
    found = [np.unique(values) for values in pieces_of(path, dimension)]
    if not found:
        raise InputError(f"{path} holds zero points")
    return np.unique(np.concatenate(found))


def frame_edges(path: Path, period_s: float) -> NDArray[np.float64]:
    """The time (T,) at which each frame begins: after each gap, or one period after the other.

    Gaps tell the frames apart when no stretch between two gaps is longer than one and a half
    periods.
    """
    bins = [np.unique(np.floor(v / TIME_BIN_S)) for v in pieces_of(path, "gps_time")]
    if not bins:
        raise InputError(f"{path} holds zero points")
    times = np.unique(np.concatenate(bins)) * TIME_BIN_S
    if not np.isfinite(times).all() or times[-1] == times[0]:
        raise InputError(f"{path} cannot be split by gps_time: it is {times[0]:g} everywhere")
    after_gap = np.flatnonzero(np.diff(times) > GAP_OF_PERIOD * period_s + TIME_BIN_S) + 1
    begins = np.concatenate([[0], after_gap])
    ends = np.concatenate([after_gap - 1, [len(times) - 1]])
    if len(begins) > 1 and (times[ends] - times[begins]).max() <= LONGEST_OF_PERIOD * period_s:
        return times[begins]
    count = int(np.floor((times[-1] - times[0]) / period_s)) + 1
    edges = times[0] + period_s * np.arange(count, dtype=np.float64)
    occupied = np.unique(np.searchsorted(edges, times + TIME_BIN_S / 2, side="right") - 1)
    return edges[occupied]


def find_runs(path: Path, dimension: str, frame_of: Any) -> Runs:
    """The stretches of rows that ``frame_of`` puts into the same frame."""
    frames, starts, stops, row = [], [], [], 0
    for values in pieces_of(path, dimension):
        frame = np.maximum(frame_of(values), 0)
        start = np.concatenate([[0], np.flatnonzero(np.diff(frame)) + 1])
        frames.append(frame[start].astype(np.int64))
        starts.append(start + row)
        stops.append(np.concatenate([start[1:], [len(frame)]]) + row)
        row += len(frame)
    return Runs(np.concatenate(frames), np.concatenate(starts), np.concatenate(stops))
