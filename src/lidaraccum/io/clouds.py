"""Read an accumulated cloud back, of any format that it can be written in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.io.columns import Columns
from lidaraccum.io.formats import read_columns
from lidaraccum.io.las import read_reference
from lidaraccum.io.listing import format_of
from lidaraccum.io.write_las import CLASSIFICATION

OWN_TYPES: Mapping[str, np.dtype[Any]] = {
    "frame": np.dtype(np.int32),
    "label": np.dtype(np.uint8),
    "instance": np.dtype(np.int32),
    "confidence": np.dtype(np.float32),
    "time": np.dtype(np.float64),
}


@dataclass(frozen=True, eq=False)
class Cloud:
    """An accumulated cloud in memory. Own fields that the file lacks are zeros.

    Attributes:
        positions: (N, 3) float64, metres, in the reference frame.
        frame: (N,) int32: index of the frame each point came from.
        label: (N,) uint8: background, still, moving.
        instance: (N,) int32, 0 for none.
        confidence: (N,) float32, 0..1.
        time: (N,) float64: seconds from the first frame; from LAS: from the first point.
        attributes: Every other column, (N,) each.
        own_fields: Names of the own fields that the file had.
        crs_wkt: Coordinate reference system, or None.
    """

    positions: NDArray[np.float64]
    frame: NDArray[np.int32]
    label: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float32]
    time: NDArray[np.float64]
    attributes: Mapping[str, NDArray[Any]]
    own_fields: frozenset[str]
    crs_wkt: str | None = None

    def __len__(self) -> int:
        return len(self.positions)


def read_cloud(path: Path | str) -> Cloud:
    """Read a ply, las, laz, pcd or npz file whole; foreign clouds are read as far as they go.

    Raises:
        InputError: Unknown format, damaged, or without points.
    """
    path = Path(path)
    columns = read_columns(path)
    crs_wkt = None
    if not len(columns.xyz):
        raise InputError(f"{path} holds zero points")
    attributes = dict(columns.attributes)
    found: dict[str, NDArray[Any]] = {}
    if format_of(path) in ("las", "laz"):
        found, attributes = own_of_las(columns)
        crs_wkt = read_reference(path).crs_wkt
    for name in OWN_TYPES:
        if name in attributes:
            found.setdefault(name, attributes.pop(name))
    count = len(columns.xyz)
    own = {n: found.get(n, np.zeros(count)).astype(kind) for n, kind in OWN_TYPES.items()}
    return Cloud(
        positions=columns.xyz.astype(np.float64),
        frame=own["frame"].astype(np.int32),
        label=own["label"].astype(np.uint8),
        instance=own["instance"].astype(np.int32),
        confidence=own["confidence"].astype(np.float32),
        time=own["time"].astype(np.float64),
        attributes=attributes,
        own_fields=frozenset(found),
        crs_wkt=crs_wkt,
    )


def own_of_las(columns: Columns) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """Own fields (N,) that LAS keeps in dimensions of its own, and the other attributes (N,)."""
    used = {
        name: values
        for name, values in columns.attributes.items()
        if name not in columns.standard or values.any()
    }
    own: dict[str, NDArray[Any]] = {}
    if "frame" in used:
        label_of = np.zeros(256, np.uint8)
        label_of[CLASSIFICATION] = np.arange(len(CLASSIFICATION), dtype=np.uint8)
        classes = columns.attributes["classification"]
        own["label"] = label_of[classes]
        used.pop("classification", None)
        used.pop("point_source_id", None)
    elif "point_source_id" in used:
        own["frame"] = used.pop("point_source_id")
    if "gps_time" in used:
        own["time"] = used["gps_time"] - used["gps_time"].min()
    return own, used
