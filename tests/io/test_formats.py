"""Each reader gives what was put into the file, and refuses what is not whole."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement

from lidaraccum.errors import InputError, MissingInputError
from lidaraccum.io.bin import read_bin
from lidaraccum.io.formats import read_columns
from lidaraccum.io.las import read_las
from lidaraccum.io.npy import read_npy, read_npz
from lidaraccum.io.ply import read_ply

Cloud = Callable[..., NDArray[np.float32]]


def ply_record(points: NDArray[Any], kind: str = "f4") -> NDArray[Any]:
    dtype = [("x", kind), ("y", kind), ("z", kind), ("scalar_gain", "f8"), ("ring", "u2")]
    record = np.zeros(len(points), dtype)
    for axis, values in zip("xyz", points.T, strict=True):
        record[axis] = values
    record["scalar_gain"] = np.arange(len(points)) / 3
    record["ring"] = np.arange(len(points))
    return record


def write_ply(path: Path, record: NDArray[Any], **options: Any) -> Path:
    PlyData([PlyElement.describe(record, "vertex")], **options).write(str(path))
    return path


@pytest.mark.parametrize("kind", ["f4", "f8"])
@pytest.mark.parametrize(
    "options", [{"text": True}, {"byte_order": "<"}, {"byte_order": ">"}], ids=str
)
def test_ply_of_every_encoding(
    tmp_path: Path, cloud: Cloud, options: dict[str, Any], kind: str
) -> None:
    points = cloud()
    columns = read_ply(write_ply(tmp_path / "a.ply", ply_record(points, kind), **options))
    np.testing.assert_array_equal(columns.xyz, points)
    assert columns.xyz.dtype == np.dtype(kind)
    np.testing.assert_array_equal(columns.attributes["gain"], np.arange(200) / 3)
    np.testing.assert_array_equal(columns.attributes["ring"], np.arange(200))
    assert columns.attributes["ring"].dtype == np.uint16


@pytest.mark.parametrize("options", [{"text": True}, {"byte_order": "<"}, {"byte_order": ">"}])
def test_a_truncated_ply_is_never_read(
    tmp_path: Path, cloud: Cloud, options: dict[str, Any]
) -> None:
    path = write_ply(tmp_path / "a.ply", ply_record(cloud()), **options)
    whole = path.read_bytes()
    for kept in (len(whole) - 40, len(whole) // 2, 60):
        path.write_bytes(whole[:kept])
        with pytest.raises(InputError, match=r"a\.ply"):
            read_ply(path)


def test_a_truncated_ply_names_bytes_found_and_expected(tmp_path: Path, cloud: Cloud) -> None:
    path = write_ply(tmp_path / "a.ply", ply_record(cloud()), byte_order="<")
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    with pytest.raises(InputError, match=f"{len(whole)} bytes in all, but has {len(whole) - 100}"):
        read_ply(path)


def test_ply_faces_are_left_out_and_said(tmp_path: Path, cloud: Cloud) -> None:
    faces = np.array([([0, 1, 2],)], dtype=[("vertex_indices", "i4", (3,))])
    elements = [
        PlyElement.describe(ply_record(cloud()), "vertex"),
        PlyElement.describe(faces, "face"),
    ]
    PlyData(elements).write(str(tmp_path / "a.ply"))
    columns = read_ply(tmp_path / "a.ply")
    np.testing.assert_array_equal(columns.xyz, cloud())
    assert columns.warnings == ("a.ply: element face is left out",)


def test_bin_as_kitti_nuscenes_and_named(tmp_path: Path, cloud: Cloud) -> None:
    table = np.column_stack([cloud(), np.arange(200), np.arange(200) % 32, np.zeros(200)])
    table = table.astype("<f4")
    for name, fields, width in (
        ("a.bin", (), 4),
        ("a.pcd.bin", (), 5),
        ("b.bin", ("x", "y", "z", "intensity", "ring", "t"), 6),
    ):
        table[:, :width].tofile(tmp_path / name)
        columns = read_bin(tmp_path / name, fields)
        np.testing.assert_array_equal(columns.xyz, cloud())
        assert list(columns.attributes) == ["intensity", "ring", "t"][: width - 3]
        np.testing.assert_array_equal(columns.attributes["intensity"], np.arange(200))


def test_a_truncated_bin_names_bytes_and_multiple(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(bytes(16 * 7 + 3))
    with pytest.raises(InputError, match=r"a\.bin has 115 bytes, not a multiple of 16.*truncated"):
        read_bin(path)


def test_five_fields_without_a_name_are_pointed_out(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(bytes(20 * 7))
    with pytest.raises(InputError, match=r"5 fields would fit.*--bin-fields"):
        read_bin(path)


def test_five_fields_are_noticed_even_when_four_would_divide(tmp_path: Path, cloud: Cloud) -> None:
    table = np.column_stack([cloud(), np.arange(200) / 7, np.arange(200) % 32])
    table.astype("<f4").tofile(tmp_path / "a.bin")
    with pytest.raises(InputError, match="looks like 5 fields"):
        read_bin(tmp_path / "a.bin")


def write_las(path: Path, points: NDArray[Any], version: str, form: int) -> laspy.LasData:
    header = laspy.LasHeader(version=version, point_format=form)
    header.scales, header.offsets = [0.001] * 3, [10.0, 20.0, 0.0]
    header.add_extra_dim(laspy.ExtraBytesParams("range", np.float32))
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T.astype(np.float64)
    las.intensity = np.arange(len(points)) * 300
    las["range"] = np.arange(len(points)) / 7
    if "gps_time" in las.point_format.dimension_names:
        las.gps_time = 1e5 + np.arange(len(points)) * 1e-4
    las.write(path)
    return las


@pytest.mark.parametrize(("version", "form"), [("1.2", 0), ("1.2", 3), ("1.3", 1), ("1.4", 6)])
@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_las_of_every_version(
    tmp_path: Path, cloud: Cloud, version: str, form: int, suffix: str
) -> None:
    path = tmp_path / f"a.{suffix}"
    las = write_las(path, cloud(), version, form)
    columns = read_las(path)
    np.testing.assert_allclose(columns.xyz, cloud(), atol=5.1e-4)
    for name in las.point_format.dimension_names:
        if name not in "XYZ":
            np.testing.assert_array_equal(columns.attributes[name], np.asarray(las[name]))
    assert "range" not in columns.standard
    assert "user_data" in columns.standard


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_a_truncated_las_is_refused(tmp_path: Path, cloud: Cloud, suffix: str) -> None:
    path = tmp_path / f"a.{suffix}"
    write_las(path, cloud(), "1.4", 6)
    whole = path.read_bytes()
    for kept in (len(whole) - 1, len(whole) // 2, 400, 300, 230, 100, 3):
        path.write_bytes(whole[:kept])
        with pytest.raises(InputError, match=rf"a\.{suffix}"):
            read_las(path)


def test_a_las_header_of_noise_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.las"
    path.write_bytes(b"LASF" + np.random.default_rng(0).bytes(5000))
    with pytest.raises(InputError, match="makes no sense"):
        read_las(path)


def test_npy_plain_and_structured(tmp_path: Path, cloud: Cloud) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([cloud(), np.arange(200)]))
    plain = read_npy(tmp_path / "a.npy")
    np.testing.assert_array_equal(plain.xyz, cloud())
    np.testing.assert_array_equal(plain.attributes["intensity"], np.arange(200))
    np.save(tmp_path / "b.npy", ply_record(cloud()))
    structured = read_npy(tmp_path / "b.npy")
    np.testing.assert_array_equal(structured.xyz, cloud())
    np.testing.assert_array_equal(structured.attributes["ring"], np.arange(200))


def test_npz_with_named_arrays(tmp_path: Path, cloud: Cloud) -> None:
    rgb = np.arange(600).reshape(200, 3)
    np.savez(tmp_path / "a.npz", points=cloud(), ring=np.arange(200), pose=np.eye(4), rgb=rgb)
    columns = read_npz(tmp_path / "a.npz")
    np.testing.assert_array_equal(columns.attributes["rgb_1"], rgb[:, 1])
    np.testing.assert_array_equal(columns.xyz, cloud())
    assert list(columns.attributes) == ["ring", "rgb_0", "rgb_1", "rgb_2"]
    assert "pose of shape (4, 4)" in columns.warnings[0]


def test_a_truncated_npy_or_npz_is_refused(tmp_path: Path, cloud: Cloud) -> None:
    np.save(tmp_path / "a.npy", cloud())
    np.savez(tmp_path / "a.npz", points=cloud())
    for name in ("a.npy", "a.npz"):
        path = tmp_path / name
        path.write_bytes(path.read_bytes()[:-200])
        with pytest.raises(InputError, match=name.replace(".", r"\.")):
            read_columns(path)


@pytest.mark.parametrize("name", ["a.ply", "a.las", "a.laz", "a.pcd", "a.npy", "a.npz"])
@pytest.mark.parametrize("content", [b"", b"hello\n" * 100, struct.pack("<100d", *range(100))])
def test_a_foreign_file_is_refused(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=name.replace(".", r"\.")):
        read_columns(tmp_path / name)


@pytest.mark.parametrize("name", ["a.bin", "a.ply", "a.las", "a.pcd", "a.npy"])
def test_a_missing_file_is_said_to_be_missing(tmp_path: Path, name: str) -> None:
    with pytest.raises(MissingInputError, match="does not exist"):
        read_columns(tmp_path / name)


@pytest.mark.parametrize("name", ["a.bin", "a.ply", "a.las", "a.pcd", "a.npy"])
def test_what_the_system_refuses_is_an_input_error(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / name).write_bytes(bytes(400))

    def refuse(*_: object, **__: object) -> object:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("builtins.open", refuse)
    monkeypatch.setattr("io.open", refuse)
    monkeypatch.setattr(os, "open", refuse)
    monkeypatch.setattr(Path, "stat", refuse)
    with pytest.raises(InputError, match="permission denied"):
        read_columns(tmp_path / name)


def whole_file(path: Path, points: NDArray[np.float32]) -> None:
    if path.suffix == ".ply":
        write_ply(path, ply_record(points))
    elif path.suffix == ".las":
        write_las(path, points, "1.4", 6)
    elif path.suffix == ".npy":
        np.save(path, points)
    else:
        np.savez_compressed(path, points=points)


@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("name", ["a.ply", "a.las", "a.npy", "a.npz"])
def test_a_damaged_file_is_read_or_refused_and_nothing_else(
    tmp_path: Path, cloud: Cloud, name: str, seed: int
) -> None:
    path = tmp_path / name
    whole_file(path, cloud())
    content = bytearray(path.read_bytes())
    rng = np.random.default_rng(seed)
    for place in rng.integers(0, min(len(content), 400), 4):
        content[place] = rng.integers(0, 256)
    path.write_bytes(content)
    said, shape = name, (3,)
    try:
        shape = read_columns(path).xyz.shape[1:]
    except InputError as error:
        said = str(error)
    assert name in said
    assert shape == (3,)
