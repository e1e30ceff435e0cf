"""From a file's columns to a `Frame`: which column means what, in which unit, from which origin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import NO_RETURN_RANGE_M, BoolArray, Frame
from lidaraccum.errors import InputError
from lidaraccum.io.columns import Columns
from lidaraccum.io.point_time import find_time

INTENSITY_NAMES = ("intensity", "scalar_intensity", "reflectivity", "remission", "reflectance", "i")
RING_NAMES = ("ring", "channel", "laser_id", "scalar_ring", "line", "row")
OUTPUT_NAMES = frozenset(
    {"frame", "label", "instance", "confidence", "time", "rows", "points", "x", "y", "z"}
)
"""Fields of our outputs: an input column of that name is carried as ``input_NAME``."""

GEOREFERENCED_M = 2000.0
"""A median coordinate beyond this, the cloud being compact, is a place on a map."""
COMPACT_M = 1000.0
FARTHEST_MEDIAN_RANGE_M = 1000.0
NEAREST_MEDIAN_RANGE_M = 0.5
NOISE_RANGE = 1e7
SAMPLE = 20_000


@dataclass(frozen=True)
class Occasion:
    """When and where a frame was taken, as far as is known without its points.

    Attributes:
        name: What the frame is called in messages.
        stamp: Seconds, of the frame.
        period_s: Seconds between frames.
        exact: The stamp was recorded; otherwise it was counted from the rate, and a clock among
            the points overrules it.
    """

    name: str
    stamp: float = 0.0
    period_s: float = 0.1
    exact: bool = False


def frame_from_columns(columns: Columns, occasion: Occasion) -> Frame:
    """Say which column means what.

    Non-finite points are dropped; ``rows`` and ``row_count`` of the frame remember them.

    Raises:
        InputError: No point, no point that came back, or a median range that no LiDAR in metres
            measures.
    """
    rows = finite_rows(columns.xyz)
    xyz = columns.xyz if rows is None else columns.xyz[rows]
    x, y, z = np.abs(xyz.T) >= NO_RETURN_RANGE_M
    returned = x | y | z
    check_any(columns, xyz, returned, occasion.name)
    origin = origin_of(xyz if returned.all() else xyz[returned], occasion.name)
    points = (xyz - origin if origin.any() else xyz).astype(np.float32, copy=False)
    attributes = {n: v if rows is None else v[rows] for n, v in columns.attributes.items()}
    time = find_time(attributes, returned, occasion.stamp, occasion.period_s, occasion.exact)
    intensity = take(attributes, INTENSITY_NAMES)
    return Frame(
        points=points,
        stamp=time.stamp,
        intensity=intensity,
        time_offset=time.offset,
        ring=take_ring(attributes),
        attributes=carried(attributes),
        origin=origin,
        name=occasion.name,
        rows=rows,
        row_count=len(columns.xyz),
    )


def finite_rows(xyz: NDArray[Any]) -> NDArray[np.int64] | None:
    """Rows (M,) of the points (N, 3) that are finite, or None when all are."""
    finite = np.isfinite(xyz)
    if finite.all():
        return None
    return np.flatnonzero(finite.all(axis=1)).astype(np.int64)


def check_any(columns: Columns, xyz: NDArray[Any], returned: BoolArray, name: str) -> None:
    """Raise InputError unless some point is finite and came back."""
    if not len(columns.xyz):
        raise InputError(f"{name} holds zero points")
    if not len(xyz):
        raise InputError(f"{name} holds {len(columns.xyz)} points, none of them finite")
    if not returned.any():
        raise InputError(f"{name} holds {len(xyz)} points, all of them at 0, 0, 0 (no return)")


def origin_of(returned: NDArray[Any], name: str) -> NDArray[np.float64]:
    """What to subtract from points (N, 3) that came back so that float32 holds them: (3,) metres.

    Raises:
        InputError: The median range is absurd for metres.
    """
    sample = returned[:: max(1, len(returned) // SAMPLE)].astype(np.float64)
    centre = np.median(sample, axis=0)
    spread = float(np.median(np.linalg.norm(sample - centre, axis=1)))
    median_range = float(np.median(np.linalg.norm(sample, axis=1)))
    if np.abs(centre).max() > GEOREFERENCED_M and spread < COMPACT_M:
        return np.round(centre)
    if median_range > FARTHEST_MEDIAN_RANGE_M and spread > COMPACT_M / 2:
        seem = "the coordinates seem to be millimetres; convert them to metres"
        noise = "these seem to be no coordinates; if it is a .bin file, name its --bin-fields"
        raise InputError(
            f"{name} has a median range of {median_range:.4g}: no LiDAR measures that in metres",
            hint=seem if median_range < NOISE_RANGE else noise,
        )
    if median_range < NEAREST_MEDIAN_RANGE_M:
        raise InputError(
            f"{name} has a median range of {median_range:.3g} m: no LiDAR measures that in metres",
            hint="the coordinates seem to be kilometres or normalised; convert them to metres",
        )
    return np.zeros(3)


def take(attributes: dict[str, NDArray[Any]], names: tuple[str, ...]) -> NDArray[Any] | None:
    """Remove and return the first column called by one of the names, in any case."""
    by_lower = {name.lower(): name for name in reversed(attributes)}
    for name in names:
        if name in by_lower:
            return attributes.pop(by_lower[name])
    return None


def take_ring(attributes: dict[str, NDArray[Any]]) -> NDArray[Any] | None:
    """Remove and return the beam index; one stored as whole floats (nuScenes) becomes uint16."""
    name = next((n for r in RING_NAMES for n in attributes if n.lower() == r), None)
    if name is None:
        return None
    values = attributes[name]
    if values.dtype.kind in "iu":
        return attributes.pop(name)
    whole = values.dtype.kind == "f" and bool(
        np.all((values >= 0) & (values < 65536) & (values == np.floor(values)))
    )
    return attributes.pop(name).astype(np.uint16) if whole else None


def carried(attributes: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The same columns, those called like one of our own output fields renamed."""
    renamed: dict[str, NDArray[Any]] = {}
    for name, values in attributes.items():
        free = name
        while free.lower() in OUTPUT_NAMES or (free != name and free in attributes):
            free = f"input_{free}"
        renamed[free] = values
    return renamed
