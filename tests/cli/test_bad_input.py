"""Every odd input: one clear sentence, exit code 3, nothing written, nothing lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest


def refused(run: Any, tmp_path: Path, *args: object, code: int = 3) -> str:
    """Run accumulate, check that it refused cleanly, and return what it said."""
    result = run("accumulate", *args, "-o", tmp_path / "out.ply")
    assert result.exit_code == code, result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert not list(tmp_path.glob("*out*")), "something was written"
    said = [line for line in result.stderr.splitlines() if line.startswith("Error: ")]
    assert len(said) == 1, result.stderr
    return said[0]


def test_nothing_there(run: Any, tmp_path: Path) -> None:
    assert "missing" in refused(run, tmp_path, tmp_path / "missing")


def test_an_empty_folder(run: Any, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert "empty" in refused(run, tmp_path, tmp_path / "empty")


def test_mixed_formats(run: Any, bins: Path, tmp_path: Path, drive: Any) -> None:
    np.save(bins / "extra.npy", drive.frames[0])
    said = refused(run, tmp_path, bins)
    assert "bin" in said
    assert "npy" in said
    assert "--format" in said


def test_one_of_mixed_formats_can_be_chosen(
    run: Any, bins: Path, tmp_path: Path, drive: Any
) -> None:
    np.save(bins / "extra.npy", drive.frames[0])
    result = run("accumulate", bins, "-o", tmp_path / "out.npz", "--format", "bin")
    assert result.exit_code == 0, result.stderr


def test_a_truncated_bin(run: Any, bins: Path, tmp_path: Path) -> None:
    path = bins / "frame_3.bin"
    content = path.read_bytes()
    path.write_bytes(content[:-7])
    said = refused(run, tmp_path, bins)
    assert "frame_3.bin" in said
    assert str(len(content) - 7) in said
    assert "16" in said


def test_zero_points(run: Any, bins: Path, tmp_path: Path) -> None:
    (bins / "frame_2.bin").write_bytes(b"")
    assert "frame_2.bin" in refused(run, tmp_path, bins)


def test_one_frame(run: Any, bins: Path, tmp_path: Path) -> None:
    for index in range(1, 6):
        (bins / f"frame_{index}.bin").unlink()
    assert "1 frame" in refused(run, tmp_path, bins)


def test_millimetres(run: Any, drive: Any, tmp_path: Path) -> None:
    folder = tmp_path / "seq"
    folder.mkdir()
    for index, points in enumerate(drive.frames):
        np.save(folder / f"{index}.npy", points * 1000)
    assert "millimetre" in refused(run, tmp_path, folder)


def test_poses_of_the_wrong_length(run: Any, bins: Path, tmp_path: Path) -> None:
    poses = tmp_path / "poses.txt"
    np.savetxt(poses, np.tile(np.eye(4)[:3].ravel(), (4, 1)))
    said = refused(run, tmp_path, bins, "--poses", poses)
    assert "4" in said
    assert "6" in said


def test_no_poses_where_some_were_asked_for(run: Any, bins: Path, tmp_path: Path) -> None:
    assert "poses" in refused(run, tmp_path, bins, "--poses", "auto")


def test_labels_where_there_are_none(run: Any, bins: Path, tmp_path: Path) -> None:
    assert "labels" in refused(run, tmp_path, bins, "--method", "oracle")


def test_all_points_broken(run: Any, bins: Path, tmp_path: Path) -> None:
    np.full((1000, 4), np.nan, dtype="<f4").tofile(bins / "frame_4.bin")
    assert "frame_4.bin" in refused(run, tmp_path, bins)


def test_a_file_that_is_something_else(run: Any, tmp_path: Path) -> None:
    folder = tmp_path / "seq"
    folder.mkdir()
    for index in range(3):
        (folder / f"{index}.ply").write_text("this is no PLY file")
    assert "0.ply" in refused(run, tmp_path, folder)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--frames", "5:1:-1"], "slice"),
        (["--rate", "-1"], "rate"),
        (["--bin-fields", "x,y"], "z"),
        (["--crop", "1,2"], "crop"),
        (["--reference", "99"], "99"),
        (["--reference", "world"], "poses"),
    ],
)
def test_options_that_make_no_sense_are_usage_errors(
    run: Any, bins: Path, tmp_path: Path, options: list[str], word: str
) -> None:
    assert word in refused(run, tmp_path, bins, *options, code=2)


def test_an_unknown_output_format(run: Any, bins: Path, tmp_path: Path) -> None:
    result = run("accumulate", bins, "-o", tmp_path / "out.xyz")
    assert result.exit_code == 2
    assert ".laz" in result.stderr


def test_a_traceback_only_when_asked_for(run: Any, tmp_path: Path) -> None:
    missing = tmp_path / "missing"
    result = run("accumulate", missing, "-o", tmp_path / "out.ply", "--traceback")
    assert result.exit_code == 3
    assert "Traceback" in result.stderr


def test_an_output_never_replaces_an_input(run: Any, bins: Path, drive: Any) -> None:
    frame = bins / "0.npz"
    np.savez(frame, points=drive.frames[0])
    np.savez(bins / "1.npz", points=drive.frames[1])
    before = frame.read_bytes()
    result = run("accumulate", bins, "-o", frame, "--format", "npz", "--overwrite")
    assert result.exit_code == 2
    assert "one of the input frames" in result.stderr
    assert frame.read_bytes() == before


@pytest.mark.parametrize("option", ["--voxel", "--min-range", "--max-range"])
def test_numbers_must_be_finite(run: Any, bins: Path, tmp_path: Path, option: str) -> None:
    assert "finite" in refused(run, tmp_path, bins, option, "nan", code=2)


def test_a_setting_of_the_wrong_kind(run: Any, bins: Path, tmp_path: Path) -> None:
    toml = tmp_path / "settings.toml"
    toml.write_text("voxel = [1]\n")
    result = run("accumulate", bins, "-o", tmp_path / "o.ply", "--config", toml)
    assert result.exit_code == 2
    assert "wrong kind" in result.stderr


@pytest.mark.parametrize("count", [2, 10, 300])
def test_too_few_points_to_trust_are_doubted_not_lost(
    run: Any, drive: Any, tmp_path: Path, count: int
) -> None:
    folder = tmp_path / "seq"
    folder.mkdir()
    for index, points in enumerate(drive.frames):
        np.save(folder / f"{index}.npy", points[::7][:count])
    result = run("accumulate", folder, "-o", tmp_path / "out.npz", "--strict")
    assert result.exit_code == 4, result.stderr
    with np.load(tmp_path / "out.npz") as cloud:
        assert len(cloud["points"]) == 6 * count


def test_an_absurd_point_is_carried_and_harms_nothing(run: Any, drive: Any, tmp_path: Path) -> None:
    folder = tmp_path / "seq"
    folder.mkdir()
    for index, points in enumerate(drive.frames):
        np.save(folder / f"{index}.npy", np.vstack([points, np.float32([[3e38, 0, 0]])]))
    result = run("accumulate", folder, "-o", tmp_path / "out.npz")
    assert result.exit_code == 0, result.stderr
    found = np.loadtxt(tmp_path / "out.poses.txt").reshape(-1, 3, 4)[:, :, 3]
    np.testing.assert_allclose(found, drive.first_from_frame[:, :3, 3], atol=0.03)
