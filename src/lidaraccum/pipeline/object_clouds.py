"""Each object's own accumulated cloud, for ``--objects-dir``."""

from __future__ import annotations

import pickle
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

import numpy as np

from lidaraccum.data.accumulation import AccumulatedFrame
from lidaraccum.io.writers import WriterSettings, open_writer


class ObjectClouds:
    """Gathers each object's points on disk frame by frame, writes its cloud on leaving."""

    def __init__(self, folder: Path, suffix: str, settings: WriterSettings) -> None:
        self._folder = folder
        self._suffix = suffix
        self._settings = settings
        self._waiting = folder / "waiting"
        self._waiting.mkdir(parents=True)

    def write(self, frame: AccumulatedFrame) -> None:
        """Take each object's points of this frame."""
        for instance in np.unique(frame.instance[frame.instance > 0]).tolist():
            with (self._waiting / str(instance)).open("ab") as parts:
                pickle.dump(frame.select(frame.instance == instance), parts)

    def __enter__(self) -> ObjectClouds:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._write_clouds()
            shutil.rmtree(self._waiting)

    def _write_clouds(self) -> None:
        """One file an object, called by its instance."""
        for gathered in sorted(self._waiting.iterdir(), key=lambda path: int(path.name)):
            target = self._folder / f"{int(gathered.name):06d}{self._suffix}"
            with open_writer(target, self._settings) as cloud:
                for part in _parts(gathered):
                    cloud.write(part)


def _parts(path: Path) -> Iterator[AccumulatedFrame]:
    with path.open("rb") as parts:
        while parts.peek(1):
            yield pickle.load(parts)
