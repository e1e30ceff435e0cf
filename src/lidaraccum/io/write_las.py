"""LAS and LAZ 1.4 out: point format 6, or 7 with colours, 1 mm, coordinate system kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from laspy.header import GpsTimeType
from numpy.typing import NDArray

from lidaraccum.io.cloud_schema import Chunk, Schema, file_name_of
from lidaraccum.io.columns import LasReference, RawVlr
from lidaraccum.io.las import PROJECTION_USER, WKT_RECORD

SCALE_M = 0.001
CLASSIFICATION = np.array([1, 64, 65], np.uint8)
"""By label: 1 unclassified; 64 and 65, free for users, are movable but still, and moving."""
COLOURS = ("red", "green", "blue")
OURS = ("classification", "point_source_id")
"""Dimensions we fill; what came in under these names is carried as ``input_NAME``."""
OWN_EXTRA = {
    "frame": np.dtype(np.int32),
    "instance": np.dtype(np.int32),
    "confidence": np.dtype("f4"),
}
NAME_BYTES = 32
LARGEST = 65535
SOURCE_IDS = 65536


@dataclass(frozen=True)
class LasTarget:
    """Where to, and in which coordinate system.

    Attributes:
        path: The file.
        compress: LAZ.
        reference: What coordinates and times refer to.
        own_fields: Write frame, label, instance, confidence; False for a sensor's own frame.
    """

    path: Path
    compress: bool
    reference: LasReference
    own_fields: bool = True


class LasEncoder:
    """Streams chunks through laspy's writer."""

    def __init__(self, target: LasTarget, first: Chunk, schema: Schema) -> None:
        self._schema = schema
        self._own = OWN_EXTRA if target.own_fields else {}
        self._intensity_scale = intensity_scale(first.attributes.get("intensity"))
        self._header = laspy.LasHeader(
            point_format=7 if all(colour in schema.types for colour in COLOURS) else 6,
            version="1.4",
        )
        self._header.scales = np.full(3, SCALE_M)
        self._header.offsets = offset_of(first.points)
        self._header.generating_software = "lidaraccum"
        self._native, extra = self._places(first)
        self._extra = {name: own for name, (own, _) in extra.items()}
        self._header.add_extra_dims(
            [
                *(laspy.ExtraBytesParams(name, kind) for name, kind in self._own.items()),
                *(laspy.ExtraBytesParams(own, kind) for own, kind in extra.values()),
            ]
        )
        add_reference(self._header, target.reference)
        self._file = target.path.open("w+b")
        self._writer = laspy.LasWriter(
            self._file, self._header, do_compress=target.compress, closefd=True
        )

    def write(self, chunk: Chunk) -> None:
        """Append one frame's points."""
        if not len(chunk):
            return
        record = laspy.ScaleAwarePointRecord.zeros(len(chunk), header=self._header)
        for axis, values in zip("xyz", chunk.points.T, strict=True):
            record[axis] = values
        if self._own:
            record["classification"] = CLASSIFICATION[chunk.own["label"]]
            record["point_source_id"] = (chunk.own["frame"] % SOURCE_IDS).astype(np.uint16)
        for name in self._own:
            record[name] = chunk.own[name]
        if "gps_time" not in self._native:
            record["gps_time"] = self._schema.time_origin + chunk.own["time"]
        for name in self._native:
            record[name] = self._fitting(name, chunk.attributes[name], record)
        for name, own in self._extra.items():
            record[own] = chunk.attributes[name]
        self._writer.write_points(record)

    def finish(self) -> None:
        """Fill in counts and bounds."""
        self._writer.close()

    def abandon(self) -> None:
        """Close the file."""
        self._file.close()

    def _places(self, first: Chunk) -> tuple[list[str], dict[str, tuple[str, np.dtype[Any]]]]:
        """Attributes that LAS has a dimension for, and the others with their name and type."""
        standard = set(self._header.point_format.standard_dimension_names) - {"X", "Y", "Z"}
        native, extra = [], {}
        taken = {*standard, *self._own}
        for name, values in first.attributes.items():
            if name in standard and not self._is_ours(name) and self._is_native(name, values):
                native.append(name)
            else:
                own = free_name(f"input_{name}" if name in standard else name, taken)
                taken.add(own)
                extra[name] = own, self._schema.types[name]
        return native, extra

    def _is_ours(self, name: str) -> bool:
        return bool(self._own) and name in OURS

    def _is_native(self, name: str, values: NDArray[Any]) -> bool:
        """Whether LAS's dimension of that name can hold the values."""
        if name in ("intensity", "gps_time", *COLOURS):
            return values.dtype.kind in "iuf"
        if values.dtype.kind not in "iu":
            return False
        low, high = self._limits(name)
        return not len(values) or bool(values.min() >= low and values.max() <= high)

    def _limits(self, name: str) -> tuple[int, int]:
        dimension = self._header.point_format.dimension_by_name(name)
        return int(dimension.min), int(dimension.max)

    def _fitting(self, name: str, values: NDArray[Any], record: Any) -> NDArray[Any]:
        """Values as LAS's own dimension takes them; what does not fit is clipped, and said."""
        if name == "gps_time":
            return values.astype(np.float64)
        if name == "intensity":
            values = values * self._intensity_scale if self._intensity_scale != 1 else values
        if name in COLOURS and values.dtype == np.uint8:
            return values.astype(np.uint16) * 257
        if values.dtype.kind == "f":
            values = np.rint(np.nan_to_num(values))
        low, high = self._limits(name)
        clipped = np.clip(values, low, high)
        if not np.array_equal(clipped, values):
            self._schema.say_once(f"{name} does not fit LAS's {low}..{high}: clipped", name)
        return clipped.astype(np.asarray(record[name]).dtype)


def intensity_scale(intensity: NDArray[Any] | None) -> float:
    """Floats between 0 and 1 fill LAS's 16 bits; anything else is kept, rounded."""
    if intensity is None or intensity.dtype.kind != "f" or not len(intensity):
        return 1.0
    return float(LARGEST) if 0.0 < float(np.nanmax(intensity)) <= 1.0 else 1.0


def offset_of(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Whole metres (3,) near the points (M, 3), so that 32 bits of millimetres reach everywhere."""
    if not len(points):
        return np.zeros(3)
    return np.round(np.median(points, axis=0) / 1000.0) * 1000.0


def free_name(name: str, taken: set[str]) -> str:
    """A name for an extra dimension: at most 32 bytes, taken by no other."""
    base = file_name_of(name)
    for attempt in range(1000):
        tail = f"_{attempt}" if attempt else ""
        short = base.encode()[: NAME_BYTES - len(tail)].decode(errors="ignore") + tail
        if short not in taken:
            return short
    raise AssertionError("a thousand attributes share their first 32 bytes")


def add_reference(header: Any, reference: LasReference) -> None:
    """The input's own records, or one made of the WKT; format 6 wants WKT where there is any."""
    crs_wkt, vlrs = reference.crs_wkt, reference.vlrs
    kept = [vlr for vlr in vlrs if vlr.record_id == WKT_RECORD] or list(vlrs)
    if crs_wkt and not any(vlr.record_id == WKT_RECORD for vlr in kept):
        kept = [RawVlr(PROJECTION_USER, WKT_RECORD, "WKT", crs_wkt.encode() + b"\0")]
    for vlr in kept:
        header.vlrs.append(laspy.VLR(vlr.user_id, vlr.record_id, vlr.description, vlr.data))
    header.global_encoding.wkt = any(vlr.record_id == WKT_RECORD for vlr in kept)
    if reference.standard_gps_time:
        header.global_encoding.gps_time_type = GpsTimeType.STANDARD
