"""`lidaraccum accumulate`, through the user's door."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from plyfile import PlyData

from lidaraccum.geometry import rigid


def load_poses(path: Path) -> np.ndarray:
    rows = np.loadtxt(path).reshape(-1, 3, 4)
    return np.concatenate([rows, np.tile([[[0, 0, 0, 1.0]]], (len(rows), 1, 1))], axis=1)


def load_cloud(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as columns:
        return dict(columns)


def test_a_folder_becomes_one_cloud_with_everything_beside_it(
    run: Any, bins: Path, drive: Any, tmp_path: Path
) -> None:
    out = tmp_path / "out.ply"
    result = run("accumulate", bins, "-o", out)
    assert result.exit_code == 0, result.stderr
    assert result.stdout == ""
    vertex = PlyData.read(out)["vertex"]
    assert len(vertex) == sum(len(points) for points in drive.frames)
    names = [prop.name for prop in vertex.properties]
    assert names[:3] == ["x", "y", "z"]
    assert {
        "scalar_frame",
        "scalar_label",
        "scalar_instance",
        "scalar_confidence",
        "scalar_time",
        "intensity",
    } <= set(names)
    np.testing.assert_array_equal(
        vertex["scalar_frame"], np.repeat(range(6), [len(points) for points in drive.frames])
    )
    np.testing.assert_allclose(
        vertex["intensity"],
        np.concatenate([np.linspace(0, 1, len(points)) for points in drive.frames]),
        atol=1e-6,
    )
    beside = sorted(path.name for path in tmp_path.iterdir() if path.name.startswith("out."))
    assert beside == ["out.objects.json", "out.ply", "out.poses.txt", "out.report.json", "out.tum"]


def test_the_poses_are_right_and_the_points_lie_where_they_say(
    run: Any, bins: Path, drive: Any, tmp_path: Path
) -> None:
    out = tmp_path / "out.npz"
    assert run("accumulate", bins, "-o", out).exit_code == 0
    poses = load_poses(tmp_path / "out.poses.txt")
    np.testing.assert_allclose(poses[:, :3, 3], drive.first_from_frame[:, :3, 3], atol=0.03)
    cloud = load_cloud(out)
    for index, points in enumerate(drive.frames):
        placed = rigid.transform(poses[index], points)
        np.testing.assert_allclose(cloud["points"][cloud["frame"] == index], placed, atol=1e-3)


@pytest.mark.parametrize("reference", ["last", "middle", "2", "-1"])
def test_another_reference_moves_the_whole_cloud_rigidly(
    run: Any, bins: Path, drive: Any, tmp_path: Path, reference: str
) -> None:
    index = {"last": 5, "middle": 3, "2": 2, "-1": 5}[reference]
    assert run("accumulate", bins, "-o", tmp_path / "first.npz").exit_code == 0
    result = run("accumulate", bins, "-o", tmp_path / "other.npz", "--reference", reference)
    assert result.exit_code == 0, result.stderr
    first_poses = load_poses(tmp_path / "first.poses.txt")
    other_from_first = rigid.invert(first_poses[index])
    np.testing.assert_allclose(
        load_poses(tmp_path / "other.poses.txt"), other_from_first @ first_poses, atol=1e-9
    )
    np.testing.assert_allclose(
        load_cloud(tmp_path / "other.npz")["points"],
        rigid.transform(other_from_first, load_cloud(tmp_path / "first.npz")["points"]),
        atol=1e-6,
    )


def test_given_poses_are_used_unchanged(run: Any, bins: Path, drive: Any, tmp_path: Path) -> None:
    shifted = rigid.translation((500_000.0, 5_400_000.0, 30.0)) @ drive.world_from_sensor
    given = tmp_path / "given.txt"
    np.savetxt(given, shifted[:, :3].reshape(-1, 12), fmt="%.17g")
    result = run(
        "accumulate", bins, "-o", tmp_path / "out.ply", "--poses", given, "--reference", "world"
    )
    assert result.exit_code == 0, result.stderr
    np.testing.assert_array_equal(load_poses(tmp_path / "out.poses.txt"), shifted)
    vertex = PlyData.read(tmp_path / "out.ply")["vertex"]
    assert vertex["x"].dtype == np.float64
    placed = np.concatenate(
        [rigid.transform(pose, points) for pose, points in zip(shifted, drive.frames, strict=True)]
    )
    got = np.column_stack([vertex["x"], vertex["y"], vertex["z"]])
    np.testing.assert_allclose(got, placed, atol=1e-6)


def test_a_glob_a_list_and_stdin_name_the_same_frames(run: Any, bins: Path, tmp_path: Path) -> None:
    files = [str(bins / f"frame_{index}.bin") for index in range(6)]
    (tmp_path / "list.txt").write_text("\n".join(files))
    sources = [([bins], None), ([f"{bins}/*.bin"], None), ([tmp_path / "list.txt"], None)]
    sources += [(files, None), (["-"], "\n".join(files))]
    clouds = []
    for number, (source, stdin) in enumerate(sources):
        out = tmp_path / f"out{number}.npz"
        result = run("accumulate", *source, "-o", out, "--no-sidecars", stdin=stdin)
        assert result.exit_code == 0, result.stderr
        clouds.append(load_cloud(out)["points"])
    for cloud in clouds[1:]:
        np.testing.assert_array_equal(cloud, clouds[0])


def test_frames_are_sliced(run: Any, bins: Path, drive: Any, tmp_path: Path) -> None:
    result = run("accumulate", bins, "-o", tmp_path / "out.npz", "--frames", "1:5:2")
    assert result.exit_code == 0, result.stderr
    cloud = load_cloud(tmp_path / "out.npz")
    assert [np.count_nonzero(cloud["frame"] == index) for index in range(2)] == [
        len(drive.frames[1]),
        len(drive.frames[3]),
    ]


def test_json_goes_to_stdout_and_says_what_the_report_says(
    run: Any, bins: Path, tmp_path: Path
) -> None:
    result = run("accumulate", bins, "-o", tmp_path / "out.ply", "--json", "-q")
    summary = json.loads(result.stdout)
    assert result.stderr == ""
    assert summary == json.loads((tmp_path / "out.report.json").read_text())
    assert summary["points_written"] == summary["points_read"] > 0
    assert summary["doubtful"] == []


def test_a_dry_run_writes_nothing(run: Any, bins: Path, tmp_path: Path) -> None:
    before = sorted(tmp_path.rglob("*"))
    result = run("accumulate", bins, "-o", tmp_path / "out.ply", "--dry-run")
    assert result.exit_code == 0
    assert "6 frames" in result.stdout
    assert "out.report.json" in result.stdout
    assert sorted(tmp_path.rglob("*")) == before


def test_an_output_is_not_replaced_unless_told(run: Any, bins: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.ply"
    out.write_text("precious")
    result = run("accumulate", bins, "-o", out)
    assert result.exit_code == 2
    assert "out.ply" in result.stderr
    assert "--overwrite" in result.stderr
    assert out.read_text() == "precious"
    assert run("accumulate", bins, "-o", out, "--overwrite").exit_code == 0
    assert out.read_bytes().startswith(b"ply")


def test_label_files_have_one_entry_for_each_input_point(
    run: Any, drive: Any, tmp_path: Path
) -> None:
    folder = tmp_path / "seq"
    folder.mkdir()
    for index, points in enumerate(drive.frames):
        rows = np.column_stack([points, np.ones(len(points), np.float32)])
        rows[7 * index] = np.nan
        rows.astype("<f4").tofile(folder / f"{index:06d}.bin")
    result = run(
        "accumulate", folder, "-o", tmp_path / "out.ply", "--labels-dir", tmp_path / "labels"
    )
    assert result.exit_code == 0, result.stderr
    assert "6 points were not finite" in result.stderr
    for index, points in enumerate(drive.frames):
        labels = np.fromfile(tmp_path / "labels" / f"{index:06d}.label", dtype=np.uint32)
        assert len(labels) == len(points)
        expected = np.full(len(points), 9)
        expected[7 * index] = 0
        np.testing.assert_array_equal(labels & 0xFFFF, expected)


def test_las_in_las_out_keeps_everything(run: Any, drive: Any, tmp_path: Path) -> None:
    folder = tmp_path / "seq"
    folder.mkdir()
    originals = []
    for index, points in enumerate(drive.frames):
        header = laspy.LasHeader(point_format=6, version="1.4")
        header.scales = [0.001] * 3
        header.add_extra_dim(laspy.ExtraBytesParams("echo_width", np.float32))
        las = laspy.LasData(header)
        las.xyz = points.astype(np.float64)
        las.intensity = np.arange(len(points)) % 60_000
        las.gps_time = 1000.0 + index / 10 + np.arange(len(points)) * 1e-9
        las.echo_width = np.arange(len(points), dtype=np.float32) / 7
        las.write(folder / f"{index:03d}.laz")
        originals.append(las)
    result = run("accumulate", folder, "-o", tmp_path / "out.laz")
    assert result.exit_code == 0, result.stderr
    out = laspy.read(tmp_path / "out.laz")
    assert len(out) == sum(len(las) for las in originals)
    for name in ("intensity", "gps_time", "echo_width"):
        together = np.concatenate([np.asarray(las[name]) for las in originals])
        np.testing.assert_array_equal(np.asarray(out[name]), together)
    np.testing.assert_array_equal(np.unique(out.classification), [1])
    assert {"frame", "instance", "confidence"} <= set(out.point_format.extra_dimension_names)


def test_a_doubtful_pose_is_reported_and_strict_exits_with_four(
    run: Any, drive: Any, tmp_path: Path
) -> None:
    rng = np.random.default_rng(1)
    frames = [points.copy() for points in drive.frames]
    frames[4] = rng.uniform(-20, 20, size=(len(frames[4]), 3)).astype(np.float32)
    folder = tmp_path / "seq"
    folder.mkdir()
    for index, points in enumerate(frames):
        np.save(folder / f"{index}.npy", points)
    result = run("accumulate", folder, "-o", tmp_path / "out.ply", "--strict")
    assert result.exit_code == 4, result.stderr
    report = json.loads((tmp_path / "out.report.json").read_text())
    assert 4 in [entry["frame"] for entry in report["doubtful"]]
