"""PCD in every encoding; the header's POINTS counts."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.io.lzf import decompress
from lidaraccum.io.pcd import read_pcd

DTYPE = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("normal", "<f4", (3,)), ("ring", "<u2")]
)
ENCODINGS = ("ascii", "binary", "binary_compressed")


def table(count: int = 20) -> NDArray[Any]:
    rng = np.random.default_rng(0)
    record = np.zeros(count, DTYPE)
    for axis in "xyz":
        record[axis] = rng.uniform(-50, 50, count)
    record["normal"] = rng.normal(size=(count, 3))
    record["ring"] = np.arange(count)
    return record


def header(points: int, encoding: str) -> bytes:
    return (
        "# .PCD v.7 - Point Cloud Data file format\nVERSION .7\nFIELDS x y z normal ring\n"
        "SIZE 4 4 4 4 2\nTYPE F F F F U\nCOUNT 1 1 1 3 1\n"
        f"WIDTH {points}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {encoding}\n"
    ).encode()


def literals(data: bytes) -> bytes:
    """LZF without a single match."""
    runs = [data[i : i + 32] for i in range(0, len(data), 32)]
    return b"".join(bytes([len(run) - 1]) + run for run in runs)


def body(record: NDArray[Any], encoding: str) -> bytes:
    if encoding == "binary":
        return record.tobytes()
    if encoding == "ascii":
        rows = [np.hstack([np.ravel(row[n]) for n in DTYPE.names or ()]) for row in record]
        return "".join(" ".join(f"{v:.9g}" for v in row) + "\n" for row in rows).encode()
    planes = b"".join(np.ascontiguousarray(record[name]).tobytes() for name in DTYPE.names or ())
    packed = literals(planes)
    return struct.pack("<II", len(packed), len(planes)) + packed


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_pcd_of_every_encoding(tmp_path: Path, encoding: str) -> None:
    path, record = tmp_path / "a.pcd", table()
    path.write_bytes(header(20, encoding) + body(record, encoding))
    columns = read_pcd(path)
    for column, axis in enumerate("xyz"):
        np.testing.assert_array_equal(columns.xyz[:, column], record[axis])
    np.testing.assert_array_equal(columns.attributes["ring"], record["ring"])
    for i in range(3):
        np.testing.assert_array_equal(columns.attributes[f"normal_{i}"], record["normal"][:, i])


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_records_after_the_headers_points_are_none(tmp_path: Path, encoding: str) -> None:
    path, record = tmp_path / "a.pcd", table()
    padded = np.concatenate([record, np.zeros(7, DTYPE)])
    path.write_bytes(header(20, encoding) + body(padded, encoding))
    assert len(read_pcd(path).xyz) == 20


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_truncated_pcd_is_refused(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.pcd"
    head, points = header(20, encoding), body(table(), encoding)
    for kept in (len(points) - 40, len(points) // 2, DTYPE.itemsize * 10, 4, 0):
        path.write_bytes(head + points[:kept])
        with pytest.raises(InputError, match=r"a\.pcd"):
            read_pcd(path)


@pytest.mark.parametrize("option", [{"write_ascii": True}, {}, {"compressed": True}], ids=str)
def test_what_open3d_writes(tmp_path: Path, option: dict[str, bool]) -> None:
    import open3d

    rng = np.random.default_rng(0)
    # Repeated values, so that the compressed file has matches of every kind.
    points = rng.integers(-3, 3, (5000, 3)).astype(np.float32)
    written = open3d.t.geometry.PointCloud(points)
    open3d.t.io.write_point_cloud(str(tmp_path / "a.pcd"), written, **option)
    np.testing.assert_array_equal(read_pcd(tmp_path / "a.pcd").xyz, points)


def test_packed_colours_stay_the_integers_they_are(tmp_path: Path) -> None:
    dtype = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<f4")])
    record = np.zeros(3, dtype)
    record["rgb"] = np.array([0x00FF0000, 0x0000FF00, 0x000000FF], np.uint32).view(np.float32)
    head = (
        "VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        "WIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA binary\n"
    )
    (tmp_path / "a.pcd").write_bytes(head.encode() + record.tobytes())
    colours = read_pcd(tmp_path / "a.pcd").attributes["rgb"]
    np.testing.assert_array_equal(colours, [0x00FF0000, 0x0000FF00, 0x000000FF])


def test_lzf_copies_what_it_is_about_to_write() -> None:
    # One literal "ab", then a match of 7 from 2 back: it overlaps its own output.
    assert decompress(b"\x01ab" + bytes([(5 << 5) | 0, 1]), 9) == b"ababababa"


def test_lzf_refuses_what_points_before_the_beginning() -> None:
    with pytest.raises(ValueError, match="before"):
        decompress(b"\x00a" + bytes([(1 << 5) | 0, 9]), 4)
