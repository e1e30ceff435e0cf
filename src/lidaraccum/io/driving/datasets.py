"""The data sets that can be converted, by the name the command line has for them."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Protocol

from lidaraccum.errors import MissingInputError, SettingsError
from lidaraccum.io.driving.log import DrivingLog

DATASETS = ("nuscenes", "waymo", "argoverse2")


class DrivingDataset(Protocol):
    """Logs in a folder."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all logs."""

    def open(self, name: str, /) -> DrivingLog:
        """The log of a name."""


def open_dataset(kind: str, source: Path, version: str | None = None) -> DrivingDataset:
    """A data set in a folder; nothing large is read yet.

    Args:
        kind: One of `DATASETS`.
        source: What each data set calls its root; for Waymo and Argoverse 2 that of one split.
        version: Of nuScenes: v1.0-mini, v1.0-trainval, ...

    Raises:
        MissingInputError: The folder does not exist or holds no log.
        SettingsError: An unknown kind, or a version for a data set that has none.
    """
    if version is not None and kind != "nuscenes":
        raise SettingsError(f"{kind} has no --version", hint="only nuscenes has")
    if not source.is_dir():
        raise MissingInputError(f"{source} is no folder")
    if kind == "nuscenes":
        from lidaraccum.io.driving.nuscenes import NuScenes

        return NuScenes(source, version)
    if kind == "waymo":
        from lidaraccum.io.driving.waymo import Waymo

        return Waymo(source)
    if kind == "argoverse2":
        from lidaraccum.io.driving.argoverse2 import Argoverse2

        return Argoverse2(source)
    raise SettingsError(f"there is no data set {kind!r}", hint=f"one of {', '.join(DATASETS)}")


def chosen_names(dataset: DrivingDataset, wanted: tuple[str, ...]) -> tuple[str, ...]:
    """The logs wanted, each once; all where none is named.

    Raises:
        SettingsError: One is not there.
    """
    known = dataset.names
    for name in wanted:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=3, cutoff=0.0)
            raise SettingsError(
                f"there is no log {name!r} among {len(known)}", hint=f"such as {', '.join(near)}"
            )
    return tuple(dict.fromkeys(wanted)) or known
