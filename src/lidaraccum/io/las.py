"""LAS and LAZ 1.2 to 1.4 in: scale and offset, extra bytes, gps_time, coordinate system."""

from __future__ import annotations

import logging
import struct
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from laspy.errors import LaspyException
from laspy.header import GpsTimeType

from lidaraccum.errors import InputError
from lidaraccum.io.columns import Columns, LasReference, RawVlr, flat, native, readable

PROJECTION_USER = "LASF_Projection"
WKT_RECORD, WKT_MATH_RECORD = 2112, 2111
GEOTIFF_DIRECTORY = 34735
logger = logging.getLogger(__name__)

DAMAGE = (LaspyException, ValueError, RuntimeError, OverflowError, MemoryError, struct.error)
"""What laspy and lazrs raise on a damaged file; counts made of noise ask for too much memory."""
POSITION = ("X", "Y", "Z")


def read_las(path: Path) -> Columns:
    """Read a LAS or LAZ file whole.

    Raises:
        InputError: Foreign, damaged or truncated.
    """
    check_header(path)
    with readable(path):
        try:
            with laspy.open(path) as reader:
                points = reader.read_points(-1)
                header = reader.header
        except DAMAGE as error:
            raise unreadable(path, error) from error
    if len(points) != header.point_count:
        raise unreadable(path, f"{header.point_count} points promised, {len(points)} found")
    return columns_of_points(points, header)


def columns_of_points(points: Any, header: Any) -> Columns:
    """Columns of a laspy point record, scaled, every dimension under LAS's name."""
    xyz = np.empty((len(points), 3))
    for column, axis in enumerate("xyz"):
        xyz[:, column] = points[axis]
    names = [n for n in points.point_format.dimension_names if n not in POSITION]
    extra = set(points.point_format.extra_dimension_names)
    attributes = flat({name: native(np.asarray(points[name])) for name in names}, len(xyz))
    vlrs = projection_vlrs(header)
    standard = frozenset(names) - extra - {"intensity"}
    return Columns(xyz, attributes, wkt_of(vlrs), vlrs, standard)


def check_header(path: Path) -> None:
    """Raise InputError unless the file's first bytes are a LAS header that fits the file.

    laspy trusts the header: a foreign one sends it reading for minutes.
    """
    with readable(path), path.open("rb") as file:
        head = file.read(375)
        size = path.stat().st_size
    if not head.startswith(b"LASF"):
        raise InputError(f"{path} is not a LAS file: it does not begin with LASF")
    if len(head) < 227:
        raise InputError(f"{path} is truncated: {size} bytes, but the header alone has 227")
    minor = head[25]
    header_size, points_start, vlr_count = struct.unpack_from("<HII", head, 94)
    compressed = bool(head[104] & 0x80)
    record_size, count = struct.unpack_from("<HI", head, 105)
    if minor >= 4 and len(head) == 375:
        count = struct.unpack_from("<Q", head, 247)[0]
    if head[24] != 1 or minor > 4 or header_size < 227 or vlr_count * 54 > points_start:
        raise InputError(f"{path} is damaged: its LAS header makes no sense")
    needed = points_start + (0 if compressed else record_size * count)
    if size < max(needed, header_size):
        raise InputError(
            f"{path} is truncated: it promises {count} points, {needed} bytes in all, "
            f"but has {size}"
        )


def unreadable(path: Path, reason: object) -> InputError:
    """The error for a body that laspy cannot read through."""
    size = path.stat().st_size
    said = reason if isinstance(reason, str) else repr(reason)
    return InputError(f"{path} is truncated or damaged at its {size} bytes: {said}")


def projection_vlrs(header: Any) -> tuple[RawVlr, ...]:
    """The header's records about the coordinate system, extended ones included."""
    records = [*header.vlrs, *(header.evlrs or ())]
    return tuple(
        RawVlr(r.user_id, r.record_id, r.description, bytes(r.record_data_bytes()))
        for r in records
        if r.user_id == PROJECTION_USER
    )


def wkt_of(vlrs: tuple[RawVlr, ...]) -> str | None:
    """The coordinate system as WKT, where a record says it so."""
    for vlr in vlrs:
        if vlr.record_id == WKT_RECORD:
            text = vlr.data.split(b"\0")[0].decode("utf-8", errors="replace").strip()
            return text or None
    return None


def wkt_of_keys(header: Any) -> str | None:
    """GeoTIFF keys, which older files have, as WKT, where pyproj is installed."""
    try:
        crs = header.parse_crs()
    except (ImportError, LaspyException, ValueError, RuntimeError) as error:
        logger.warning("the GeoTIFF keys cannot be put into WKT: %s", error)
        return None
    return None if crs is None else str(crs.to_wkt("WKT1_GDAL"))


def read_reference(path: Path) -> LasReference:
    """What a LAS file says about its coordinates and times, its points unread."""
    check_header(path)
    with readable(path):
        try:
            with laspy.open(path) as reader:
                header = reader.header
                vlrs = projection_vlrs(header)
                has_keys = any(vlr.record_id == GEOTIFF_DIRECTORY for vlr in vlrs)
                wkt = wkt_of(vlrs) or (wkt_of_keys(header) if has_keys else None)
                is_standard = header.global_encoding.gps_time_type == GpsTimeType.STANDARD
        except DAMAGE as error:
            raise unreadable(path, error) from error
    return LasReference(wkt, vlrs, is_standard)
