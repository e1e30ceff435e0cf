"""What is written is read back, by us and by others, in the user's units."""

from __future__ import annotations

import logging
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import pytest
from laspy.header import GpsTimeType
from plyfile import PlyData

from lidaraccum.data.accumulation import AccumulatedFrame
from lidaraccum.errors import InputError, OutputError, OutputExistsError, SettingsError
from lidaraccum.io.clouds import read_cloud
from lidaraccum.io.columns import RawVlr
from lidaraccum.io.sequences import open_sequence
from lidaraccum.io.writers import SUFFIXES, WriterSettings, open_writer

Make = Callable[..., AccumulatedFrame]
UTM = (500_000.0, 5_400_000.0, 300.0)
WKT = 'LOCAL_CS["a street",UNIT["metre",1]]'


def write(path: Path, frames: list[AccumulatedFrame], **settings: object) -> Path:
    with open_writer(path, WriterSettings(**settings)) as writer:  # type: ignore[arg-type]
        for frame in frames:
            writer.write(frame)
    assert [p.name for p in path.parent.iterdir() if p.name.startswith(".")] == []
    return path


def together(frames: list[AccumulatedFrame], name: str) -> np.ndarray:
    return np.concatenate([getattr(frame, name) for frame in frames])


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), UTM], ids=["near", "utm"])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_write_read_is_identity(
    tmp_path: Path, accumulated: Make, suffix: str, shift: tuple[float, float, float]
) -> None:
    frames = [accumulated(i, shift=shift) for i in range(3)]
    cloud = read_cloud(write(tmp_path / f"out{suffix}", frames))
    np.testing.assert_allclose(cloud.positions, together(frames, "points"), rtol=0, atol=5e-4)
    np.testing.assert_array_equal(cloud.frame, np.repeat([0, 1, 2], 50))
    for name in ("label", "instance", "confidence"):
        np.testing.assert_array_equal(getattr(cloud, name), together(frames, name))
    times = together(frames, "time")
    start = times.min() if suffix in (".las", ".laz") else 0.0
    np.testing.assert_allclose(cloud.time, times - start, atol=1e-6)
    assert set(cloud.attributes) - {"gps_time"} == set(frames[0].attributes)
    for name in frames[0].attributes:
        expected = np.concatenate([frame.attributes[name] for frame in frames])
        np.testing.assert_array_equal(cloud.attributes[name], expected, err_msg=name)


def test_coordinates_that_grow_large_later_become_double(tmp_path: Path, accumulated: Make) -> None:
    frames = [accumulated(0), accumulated(1, shift=UTM), accumulated(2)]
    for suffix in (".ply", ".pcd"):
        cloud = read_cloud(write(tmp_path / f"out{suffix}", frames))
        np.testing.assert_allclose(cloud.positions, together(frames, "points"), rtol=0, atol=5e-4)
        np.testing.assert_array_equal(cloud.instance, together(frames, "instance"))


def test_ply_has_the_fields_of_the_contract(tmp_path: Path, accumulated: Make) -> None:
    path = write(tmp_path / "out.ply", [accumulated()])
    data = PlyData.read(str(path))
    kinds = {p.name: p.val_dtype for p in data["vertex"].properties}
    assert kinds == {
        "x": "f4",
        "y": "f4",
        "z": "f4",
        "scalar_frame": "i4",
        "scalar_label": "u1",
        "scalar_instance": "i4",
        "scalar_confidence": "f4",
        "scalar_time": "f4",
        "intensity": "f4",
        "scalar_ring": "u1",
        "scalar_range_mm": "f8",
        "scalar_near_ir": "f4",
        "scalar_azimuth": "f8",
        "scalar_offset": "i4",
    }
    assert any("100.000000000" in comment for comment in data.comments)


def test_open3d_reads_every_field_of_the_ply(tmp_path: Path, accumulated: Make) -> None:
    import open3d

    frames = [accumulated(i) for i in range(2)]
    path = write(tmp_path / "out.ply", frames)
    tensor = open3d.t.io.read_point_cloud(str(path))
    points = together(frames, "points")
    np.testing.assert_allclose(tensor.point.positions.numpy(), points, atol=1e-4)
    for name in ("label", "instance", "confidence", "time"):
        read = tensor.point[f"scalar_{name}"].numpy()[:, 0]
        np.testing.assert_allclose(read, together(frames, name), atol=1e-6, err_msg=name)
    np.testing.assert_array_equal(tensor.point["scalar_frame"].numpy()[:, 0], np.repeat([0, 1], 50))
    for name in frames[0].attributes:
        known = name if name == "intensity" else f"scalar_{name}"
        expected = np.concatenate([frame.attributes[name] for frame in frames])
        np.testing.assert_array_equal(tensor.point[known].numpy()[:, 0], expected, err_msg=name)
    legacy = open3d.io.read_point_cloud(str(path))
    np.testing.assert_allclose(np.asarray(legacy.points), points, atol=1e-4)


def test_open3d_reads_the_pcd(tmp_path: Path, accumulated: Make) -> None:
    import open3d

    frame = accumulated()
    path = write(tmp_path / "out.pcd", [frame])
    tensor = open3d.t.io.read_point_cloud(str(path))
    np.testing.assert_allclose(tensor.point.positions.numpy(), frame.points, atol=1e-4)
    np.testing.assert_array_equal(tensor.point["instance"].numpy()[:, 0], frame.instance)


def test_numpy_reads_the_npz(tmp_path: Path, accumulated: Make) -> None:
    frame = accumulated()
    with np.load(write(tmp_path / "out.npz", [frame])) as archive:
        assert set(archive.files) == {
            "points", "frame", "label", "instance", "confidence", "time", *frame.attributes
        }  # fmt: skip
        np.testing.assert_array_equal(archive["points"], frame.points)
        for name, values in frame.attributes.items():
            assert archive[name].dtype == values.dtype


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_follows_the_contract(tmp_path: Path, accumulated: Make, suffix: str) -> None:
    frames = [accumulated(0), accumulated(1)]
    path = write(tmp_path / f"out{suffix}", frames, crs_wkt=WKT)
    las = laspy.read(path)
    assert (str(las.header.version), las.header.point_format.id) == ("1.4", 6)
    np.testing.assert_array_equal(las.header.scales, [0.001] * 3)
    classes = np.array([1, 64, 65])[together(frames, "label")]
    np.testing.assert_array_equal(las.classification, classes)
    np.testing.assert_array_equal(las.point_source_id, np.repeat([0, 1], 50))
    np.testing.assert_array_equal(las["frame"], np.repeat([0, 1], 50))
    np.testing.assert_allclose(las.gps_time, 100.0 + together(frames, "time"), atol=1e-9)
    assert las.header.global_encoding.wkt
    assert las.header.vlrs.get("WktCoordinateSystemVlr")[0].string == WKT
    assert read_cloud(path).crs_wkt == WKT


def test_las_writes_the_inputs_projection_records_back(tmp_path: Path, accumulated: Make) -> None:
    record = RawVlr("LASF_Projection", 2112, "as it came", WKT.encode() + b"\0")
    path = write(tmp_path / "out.las", [accumulated()], vlrs=(record,))
    assert [v.record_id for v in laspy.read(path).header.vlrs if v.user_id == record.user_id] == [
        2112
    ]
    assert read_cloud(path).crs_wkt == WKT


def test_geotiff_keys_are_written_back_when_there_is_no_wkt(
    tmp_path: Path, accumulated: Make
) -> None:
    keys = np.array([1, 1, 0, 1, 3072, 0, 1, 25832], "<u2").tobytes()
    record = RawVlr("LASF_Projection", 34735, "keys", keys)
    header = laspy.read(write(tmp_path / "out.las", [accumulated()], vlrs=(record,))).header
    [kept] = [vlr for vlr in header.vlrs if vlr.record_id == 34735]
    assert kept.record_data_bytes() == keys
    assert not header.global_encoding.wkt


def test_las_to_las_loses_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = [0.001] * 3, [500_000.0, 5_400_000.0, 0.0]
    header.global_encoding.gps_time_type = GpsTimeType.STANDARD
    header.add_extra_dim(laspy.ExtraBytesParams("Amplitude", np.float32))
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", WKT.encode() + b"\0"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = rng.uniform(-50, 50, (3, 300)) + np.array(UTM)[:, None]
    las.intensity = rng.integers(0, 65536, 300)
    las.gps_time = 123_456.0 + np.sort(rng.uniform(0, 0.1, 300))
    las["Amplitude"] = rng.random(300)
    (tmp_path / "in").mkdir()
    las.write(tmp_path / "in" / "0.laz")
    sequence = open_sequence(tmp_path / "in")
    frame = sequence[0]
    accumulated = AccumulatedFrame(
        index=0,
        points=frame.points.astype(np.float64) + frame.origin,
        rows=np.arange(300),
        row_count=300,
        label=np.zeros(300, np.uint8),
        instance=np.zeros(300, np.int32),
        confidence=np.ones(300, np.float32),
        time=frame.time_offset,
        range_m=np.ones(300, np.float32),
        stamp=frame.stamp,
        reference_from_sensor=np.eye(4),
        attributes={"intensity": frame.intensity, **frame.attributes},
    )
    path = write(
        tmp_path / "out.laz",
        [accumulated],
        crs_wkt=sequence.crs_wkt,
        vlrs=sequence.crs_vlrs,
        standard_gps_time=sequence.las_reference.standard_gps_time,
    )
    back = laspy.read(path)
    assert len(back.points) == 300
    for axis in "xyz":
        np.testing.assert_allclose(back[axis], las[axis], rtol=0, atol=1e-6)
    for name in ("intensity", "gps_time", "Amplitude"):
        np.testing.assert_array_equal(back[name], las[name])
    assert back.header.vlrs.get("WktCoordinateSystemVlr")[0].string == WKT
    assert back.header.global_encoding.gps_time_type == GpsTimeType.STANDARD


def test_las_keeps_its_own_dimensions_and_carries_ours_apart(
    tmp_path: Path, accumulated: Make
) -> None:
    rng = np.random.default_rng(0)
    came = {
        "gps_time": 3e5 + rng.random(20),
        "return_number": rng.integers(1, 4, 20).astype(np.uint8),
        "classification": rng.integers(0, 9, 20).astype(np.uint8),
        "point_source_id": rng.integers(0, 9, 20).astype(np.uint16),
        "red": rng.integers(0, 65536, 20).astype(np.uint16),
        "green": rng.integers(0, 65536, 20).astype(np.uint16),
        "blue": rng.integers(0, 65536, 20).astype(np.uint16),
        "a name that is much longer than LAS allows": rng.random(20),
    }
    las = laspy.read(write(tmp_path / "out.laz", [accumulated(count=20, attributes=came)]))
    assert las.header.point_format.id == 7
    for name in ("gps_time", "return_number", "red", "green", "blue"):
        np.testing.assert_array_equal(las[name], came[name])
    for name in ("classification", "point_source_id"):
        np.testing.assert_array_equal(las[f"input_{name}"], came[name])
    np.testing.assert_array_equal(
        las["a_name_that_is_much_longer_than_"],
        came["a name that is much longer than LAS allows"],
    )


@pytest.mark.parametrize(
    ("values", "expected"),
    [([0.0, 0.5, 1.0], [0, 32768, 65535]), ([0.0, 7.4, 255.0], [0, 7, 255])],
    ids=["unit", "wide"],
)
def test_las_intensity_of_floats(
    tmp_path: Path, accumulated: Make, values: list[float], expected: list[int]
) -> None:
    frame = accumulated(count=3, attributes={"intensity": np.array(values, np.float32)})
    las = laspy.read(write(tmp_path / "out.las", [frame]))
    np.testing.assert_array_equal(las.intensity, expected)


def test_las_says_when_it_clips(
    tmp_path: Path, accumulated: Make, caplog: pytest.LogCaptureFixture
) -> None:
    frame = accumulated(count=2, attributes={"intensity": np.array([1, 70000], np.int32)})
    las = laspy.read(write(tmp_path / "out.las", [frame]))
    np.testing.assert_array_equal(las.intensity, [1, 65535])
    assert "intensity does not fit" in caplog.text


def test_later_frames_fit_the_first_ones_columns(
    tmp_path: Path, accumulated: Make, caplog: pytest.LogCaptureFixture
) -> None:
    full = {"intensity": np.ones(4, np.uint8), "gain": np.ones(4)}
    other = {"intensity": np.ones(4, np.uint8), "noise": np.ones(4)}
    frames = [accumulated(i, 4, attributes=full if i == 0 else other) for i in range(3)]
    with caplog.at_level(logging.WARNING):
        cloud = read_cloud(write(tmp_path / "out.npz", frames))
    assert set(cloud.attributes) == {"intensity", "gain"}
    np.testing.assert_array_equal(np.isnan(cloud.attributes["gain"]), np.repeat([0, 1, 1], 4))
    assert len(caplog.records) == 2


def test_an_empty_frame_is_no_obstacle(tmp_path: Path, accumulated: Make) -> None:
    unit = {"intensity": np.linspace(0, 1, 50, dtype=np.float32)}
    frames = [accumulated(i, shift=UTM, attributes=unit) for i in range(2)]
    frames[0] = frames[0].select(np.zeros(50, dtype=np.bool_))
    for suffix in SUFFIXES:
        cloud = read_cloud(write(tmp_path / f"out{suffix}", frames))
        np.testing.assert_allclose(cloud.positions, frames[1].points, rtol=0, atol=5e-4)
        scale = 65535 if suffix in (".las", ".laz") else 1
        np.testing.assert_allclose(
            cloud.attributes["intensity"] / scale, unit["intensity"], atol=1e-5
        )
        np.testing.assert_array_equal(cloud.frame, np.full(50, 1))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_cloud_of_no_points_is_a_whole_file(
    tmp_path: Path, accumulated: Make, suffix: str
) -> None:
    nothing = accumulated().select(np.zeros(50, dtype=np.bool_))
    path = write(tmp_path / f"out{suffix}", [nothing, nothing])
    with pytest.raises(InputError, match="zero points"):
        read_cloud(path)


def test_an_existing_output_is_refused_unless_asked(tmp_path: Path, accumulated: Make) -> None:
    path = write(tmp_path / "out.ply", [accumulated()])
    before = path.read_bytes()
    with pytest.raises(OutputExistsError, match=r"out\.ply"):
        open_writer(path)
    assert path.read_bytes() == before
    write(path, [accumulated(count=9)], overwrite=True)
    assert len(read_cloud(path)) == 9


def test_a_directory_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "out.ply").mkdir()
    with pytest.raises(OutputError, match="directory"):
        open_writer(tmp_path / "out.ply", WriterSettings(overwrite=True))


def test_an_unknown_suffix_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"\.ply"):
        open_writer(tmp_path / "out.xyz")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_exception_leaves_nothing(
    tmp_path: Path, accumulated: Make, suffix: str, error: type[BaseException]
) -> None:
    def interrupted() -> None:
        with open_writer(tmp_path / f"out{suffix}") as writer:
            writer.write(accumulated())
            raise error

    with pytest.raises(error):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_no_frame_is_no_output(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="no frame"), open_writer(tmp_path / "out.ply"):
        pass
    assert list(tmp_path.iterdir()) == []


ENDLESS = """
import sys
import numpy as np
from lidaraccum.data.accumulation import AccumulatedFrame
from lidaraccum.io.sequences import open_sequence
from lidaraccum.io.writers import open_writer
n = 1000
with open_writer(sys.argv[1]) as writer:
    for index in range(10**9):
        writer.write(AccumulatedFrame(
            index=index, points=np.ones((n, 3)), rows=np.arange(n), row_count=n,
            label=np.zeros(n, "u1"), instance=np.zeros(n, "i4"), confidence=np.zeros(n, "f4"),
            time=np.zeros(n), range_m=np.ones(n, "f4"), stamp=0.0,
            reference_from_sensor=np.eye(4), attributes={}))
        print(index, flush=True)
"""


@pytest.mark.parametrize("suffix", [".ply", ".laz", ".npz"])
def test_a_killed_process_leaves_nothing_under_the_final_name(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"out{suffix}"
    with subprocess.Popen(
        [sys.executable, "-c", ENDLESS, str(path)], stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == b"0"
        process.send_signal(signal.SIGKILL)
        process.stdout.read()
    assert process.returncode == -signal.SIGKILL
    assert not path.exists()
    assert any(p.name.startswith(f".out{suffix}.tmp-") for p in tmp_path.iterdir())
