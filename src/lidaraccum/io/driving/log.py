"""A driving log as a labelled sequence, whatever data set it is of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray, Frame, Labels
from lidaraccum.errors import InputError, MissingInputError
from lidaraccum.io.driving.labelling import Sighted, label
from lidaraccum.io.driving.tracks import Track


def nothing_in(root: Path, what: str, splits: Sequence[str], layout: str) -> MissingInputError:
    """The error for a folder that holds no log, with the way to one where its folders hold some.

    Args:
        root: The folder.
        what: What it should hold.
        splits: Names of its folders that hold what it should hold.
        layout: What SRC must be, where none does.
    """
    hint = f"name one split, {root / splits[0]}" if splits else f"SRC is {layout}"
    return MissingInputError(f"{root} holds no {what}", hint=hint)


@dataclass(frozen=True, eq=False)
class Sweep:
    """One turn of the sensor.

    Attributes:
        frame: Its points, sensor coordinates.
        scored: (N,) False for points about which the boxes say nothing; None: they say all.
    """

    frame: Frame
    scored: BoolArray | None = None


@dataclass(frozen=True, eq=False)
class DrivingLog:
    """What a data set says of one drive.

    Attributes:
        name: The data set's name for it.
        dataset: Which data set.
        sensor: What took it.
        licence: Of the data, which conversion does not change.
        coordinates: What the sensor coordinates are, in words.
        stamps: (T,) increasing seconds, of the sweeps.
        world_from_sensor: (T, 4, 4).
        drawn_at: (A,) increasing seconds at which somebody drew boxes, stamps of sweeps.
        tracks: All that can move.
        read: The sweep of an index.
    """

    name: str
    dataset: str
    sensor: str
    licence: str
    coordinates: str
    stamps: NDArray[np.float64]
    world_from_sensor: NDArray[np.float64]
    drawn_at: NDArray[np.float64]
    tracks: tuple[Track, ...]
    read: Callable[[int], Sweep]


class LabelledLog:
    """Implements `LabelledSequence` for a driving log.

    Sweeps before the first and after the last stamp at which boxes were drawn are left out: what
    can be seen in them only is in no box. An object's instance is its place in ``log.tracks``,
    counted from 1.

    Raises:
        InputError: Fewer than two sweeps are left.
    """

    def __init__(self, log: DrivingLog) -> None:
        self._log = log
        drawn = log.drawn_at
        known = (log.stamps >= drawn[0]) & (log.stamps <= drawn[-1]) if len(drawn) else drawn > 0
        self._chosen = np.flatnonzero(known).tolist()
        if len(self._chosen) < 2:
            raise InputError(
                f"{log.dataset} log {log.name} has {len(self._chosen)} annotated sweeps of "
                f"{len(log.stamps)}; it takes at least 2",
                hint="test splits come without boxes",
            )
        self._last: tuple[int, Sweep] | None = None

    @property
    def name(self) -> str:
        """The log's name."""
        return self._log.name

    @property
    def rate_hz(self) -> float:
        """Sweeps a second."""
        return 1.0 / float(np.median(np.diff(self._log.stamps)))

    @property
    def poses(self) -> NDArray[np.float64]:
        """(T, 4, 4) world_from_sensor, the data set's own."""
        return self._log.world_from_sensor[self._chosen]

    @property
    def crs_wkt(self) -> str | None:
        """None: the data sets' worlds are their own."""
        return None

    def __len__(self) -> int:
        return len(self._chosen)

    def __getitem__(self, index: int, /) -> Frame:
        return self._sweep(index).frame

    def labels(self, index: int, /) -> Labels:
        """The truth about sweep ``index``, row by row with its points."""
        sweep, place = self._sweep(index), self._chosen[index]
        stamp = float(self._log.stamps[place])
        sightings = [track.at(stamp, self._log.drawn_at) for track in self._log.tracks]
        objects = tuple(
            Sighted(number, track.category, sighting)
            for number, (track, sighting) in enumerate(
                zip(self._log.tracks, sightings, strict=True), start=1
            )
            if sighting is not None
        )
        pose = self._log.world_from_sensor[place]
        return label(sweep.frame.points, pose, objects, sweep.scored)

    def _sweep(self, index: int) -> Sweep:
        place = self._chosen[index]
        if self._last is None or self._last[0] != place:
            self._last = (place, self._log.read(place))
        return self._last[1]
