"""Any source of frames opens as the same lazy sequence, and what was found is said."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.data.sequence import LabelledSequence, Sequence
from lidaraccum.errors import InputError, MissingInputError, SettingsError
from lidaraccum.geometry import rigid
from lidaraccum.io.poses import kitti_text, tum_text
from lidaraccum.io.sequences import InputSettings, open_sequence

Cloud = Callable[..., NDArray[np.float32]]
Folder = Callable[..., Path]


@pytest.fixture
def folder(tmp_path: Path, cloud: Cloud) -> Folder:
    """A folder of KITTI frames; frame i's first intensity is i."""

    def make(names: list[str], place: str = "") -> Path:
        (tmp_path / place).mkdir(parents=True, exist_ok=True)
        for index, name in enumerate(names):
            width = 5 if name.endswith(".pcd.bin") else 4
            table = np.column_stack([cloud(seed=index), np.full((200, width - 3), index)])
            table.astype("<f4").tofile(tmp_path / place / name)
        return tmp_path

    return make


def order(source: object, **settings: object) -> list[int]:
    sequence = open_sequence(source, InputSettings(**settings))  # type: ignore[arg-type]
    return [int(frame.intensity[0]) for frame in (sequence[i] for i in range(len(sequence)))]


def drive(count: int) -> NDArray[np.float64]:
    twist = np.array([0.0, 0.0, 0.05, 1.0, 0.02, 0.0])
    return rigid.exponentials(twist[None], np.arange(count, dtype=np.float64))


def test_natural_sort(folder: Folder) -> None:
    place = folder(["frame_2.bin", "frame_9.bin", "frame_10.bin", "frame_100.bin"])
    assert order(place) == [0, 1, 2, 3]
    assert order(str(place / "*.bin")) == [0, 1, 2, 3]


def test_a_list_keeps_its_own_order(folder: Folder) -> None:
    place = folder(["a.bin", "b.bin", "c.bin"], "data")
    (place / "list.txt").write_text("# newest first\ndata/c.bin\n\ndata/a.bin\n")
    assert order(place / "list.txt") == [2, 0]
    assert order([place / "data" / "b.bin", place / "data" / "a.bin"]) == [1, 0]


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1:3", [1, 2]), ("::2", [0, 2, 4]), ("-2:", [3, 4]), ("3", [3]), ("-1", [4]), ("", None)],
)
def test_frames_are_a_slice(folder: Folder, text: str, expected: list[int] | None) -> None:
    place = folder([f"{i}.bin" for i in range(5)])
    assert order(place, frames=text) == (expected or [0, 1, 2, 3, 4])


def test_every_other_frame_halves_the_rate(folder: Folder) -> None:
    place = folder([f"{i}.bin" for i in range(5)])
    (place / "times.txt").write_text("0\n0.05\n0.1\n0.15\n0.2\n")
    sequence = open_sequence(place, InputSettings(frames="1::2"))
    assert sequence.rate_hz == pytest.approx(10.0)
    assert [sequence[i].stamp for i in range(2)] == [0.05, 0.15]


@pytest.mark.parametrize("text", ["a:b", "1:2:0", "1:2:-1", "1:2:3:4", "x"])
def test_what_is_no_slice_is_a_wrong_setting(text: str) -> None:
    with pytest.raises(SettingsError, match="a:b"):
        InputSettings(frames=text)


def test_a_sequence_is_what_the_protocols_say(folder: Folder) -> None:
    sequence = open_sequence(folder(["0.bin", "1.bin"]))
    assert isinstance(sequence, Sequence)
    assert isinstance(sequence, LabelledSequence)
    assert not sequence.has_labels
    assert sequence.poses is None
    with pytest.raises(InputError, match="no labels"):
        sequence.labels(0)
    with pytest.raises(IndexError):
        sequence[2]


def test_mixed_formats_are_counted_and_a_choice_settles_it(folder: Folder) -> None:
    place = folder(["0.bin", "1.bin", "2.bin"])
    np.save(place / "3.npy", np.ones((3, 3)))
    with pytest.raises(InputError, match=r"3 bin, 1 npy.*--format"):
        open_sequence(place)
    assert len(open_sequence(place, InputSettings(format="bin"))) == 3
    with pytest.raises(MissingInputError, match="no ply"):
        open_sequence(place, InputSettings(format="ply"))


def test_nothing_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(MissingInputError, match="holds no frame"):
        open_sequence(tmp_path)
    for absent in (tmp_path / "absent", str(tmp_path / "*.ply"), [tmp_path / "a.bin"]):
        with pytest.raises(MissingInputError):
            open_sequence(absent)


def test_a_broken_link_is_a_missing_frame(folder: Folder) -> None:
    place = folder(["0.bin", "1.bin"])
    (place / "2.bin").symlink_to(place / "gone.bin")
    with pytest.raises(MissingInputError, match=r"2\.bin does not exist"):
        open_sequence(place)


@pytest.mark.parametrize("meta", ['{"hz": 0}', '{"hz": "fast"}', '{"times": ["a"]}', "{", "[]"])
def test_a_meta_file_that_makes_no_sense_is_refused(folder: Folder, meta: str) -> None:
    root = folder(["0.bin"], "frames")
    (root / "meta.json").write_text(meta)
    with pytest.raises(InputError, match=r"meta\.json"):
        open_sequence(root)


def test_frames_one_folder_further_down_are_pointed_at(folder: Folder) -> None:
    with pytest.raises(MissingInputError, match="its folder drive_7 holds frames"):
        open_sequence(folder(["0.bin"], "drive_7"))


def test_one_frame_opens_but_is_not_enough(folder: Folder) -> None:
    sequence = open_sequence(folder(["0.bin"]) / "0.bin")
    assert sequence.info.frames == 1
    with pytest.raises(InputError, match="1 frame, but 2"):
        sequence.require_frames(2)


def test_a_truncated_frame_is_found_on_opening(folder: Folder) -> None:
    place = folder(["0.bin", "1.bin"])
    (place / "1.bin").write_bytes((place / "1.bin").read_bytes()[:-3])
    with pytest.raises(InputError, match=r"1\.bin has 3197 bytes, not a multiple of 16"):
        open_sequence(place)


def test_the_given_rate_overrules_times(folder: Folder) -> None:
    place = folder(["0.bin", "1.bin", "2.bin"])
    (place / "times.txt").write_text("5.0\n5.11\n5.2\n")
    sequence = open_sequence(place)
    assert [sequence[i].stamp for i in range(3)] == [5.0, 5.11, 5.2]
    assert sequence.info.times_from == "times.txt"
    given = open_sequence(place, InputSettings(rate_hz=20))
    assert [given[i].stamp for i in range(3)] == [0.0, 0.05, 0.1]
    assert given.info.rate_from == "the given rate"


def test_times_of_the_wrong_length_are_not_used_and_said(folder: Folder) -> None:
    place = folder(["0.bin", "1.bin", "2.bin"])
    (place / "times.txt").write_text("5.0\n5.11\n")
    sequence = open_sequence(place)
    assert sequence[1].stamp == pytest.approx(0.1)
    assert "2 times for 3 frames" in sequence.info.warnings[0]


def test_poses_are_used_only_when_asked(folder: Folder) -> None:
    place = folder(["0.bin", "1.bin", "2.bin"])
    (place / "poses.txt").write_text(kitti_text(drive(3)))
    sequence = open_sequence(place)
    assert sequence.poses is None
    assert sequence.info.poses_file == place / "poses.txt"
    used = open_sequence(place, InputSettings(poses="auto", frames="1:"))
    np.testing.assert_allclose(used.poses, drive(3)[1:], atol=1e-15)


def test_poses_of_the_wrong_length_are_refused(folder: Folder) -> None:
    place = folder(["0.bin", "1.bin", "2.bin"])
    (place / "other.txt").write_text(kitti_text(drive(2)))
    sequence = open_sequence(place, InputSettings(poses=str(place / "other.txt")))
    with pytest.raises(InputError, match="2 poses for 3 frames"):
        _ = sequence.poses


def test_tum_poses_find_their_frames_by_stamp(folder: Folder) -> None:
    place = folder(["0.bin", "1.bin", "2.bin"])
    (place / "times.txt").write_text("100.0\n100.1\n100.2\n")
    stamps = 99.98 + 0.05 * np.arange(8)
    (place / "dense.tum").write_text(tum_text(drive(8), stamps))
    sequence = open_sequence(place, InputSettings(poses=str(place / "dense.tum")))
    np.testing.assert_allclose(sequence.poses, drive(8)[[0, 2, 4]], atol=1e-12)
    (place / "late.tum").write_text(tum_text(drive(8), stamps + 0.2))
    late = open_sequence(place, InputSettings(poses=str(place / "late.tum")))
    with pytest.raises(InputError, match="2 of 3 frames have no pose"):
        _ = late.poses


def test_auto_poses_that_are_not_there_are_said(folder: Folder) -> None:
    sequence = open_sequence(folder(["0.bin", "1.bin"]), InputSettings(poses="auto"))
    with pytest.raises(MissingInputError, match="no poses"):
        _ = sequence.poses


TR = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])


def test_semantic_kitti(folder: Folder) -> None:
    root = folder(["000000.bin", "000001.bin"], "velodyne")
    (root / "times.txt").write_text("0\n0.104\n")
    camera = TR @ drive(2) @ rigid.invert(TR)
    (root / "poses.txt").write_text(kitti_text(camera))
    (root / "calib.txt").write_text("P0: 1 2\nTr: " + kitti_text(TR[None]))
    (root / "labels").mkdir()
    words = np.full(200, 40, "<u4")
    words[:4] = [10 | (7 << 16), 252 | (8 << 16), 0, 30]
    for i in range(2):
        words.tofile(root / "labels" / f"{i:06d}.label")
    sequence = open_sequence(root, InputSettings(poses="auto"))
    assert sequence.info.layout == "SemanticKITTI sequence"
    assert sequence[1].stamp == 0.104
    np.testing.assert_allclose(sequence.poses, drive(2), atol=1e-12)
    labels = sequence.labels(1)
    np.testing.assert_allclose(labels.world_from_sensor, drive(2)[1], atol=1e-12)
    np.testing.assert_array_equal(labels.instance[:4], [7, 8, 0, 0])
    np.testing.assert_array_equal(np.flatnonzero(labels.dynamic), [1])
    np.testing.assert_array_equal(np.flatnonzero(labels.foreground), [0, 1, 3])
    np.testing.assert_array_equal(np.flatnonzero(~labels.annotated), [2])


def test_kitti_raw(folder: Folder) -> None:
    root = folder(["0000000000.bin", "0000000001.bin"], "velodyne_points/data")
    (root / "velodyne_points" / "timestamps.txt").write_text(
        "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.074000000\n"
    )
    sequence = open_sequence(root)
    assert sequence.info.layout == "KITTI raw drive"
    assert sequence[0].stamp == pytest.approx(1317042145.964389445, abs=1e-6)
    assert sequence[1].stamp - sequence[0].stamp == pytest.approx(0.109610555, abs=1e-6)


def test_nuscenes_samples_and_sweeps_are_one_drive(folder: Folder) -> None:
    root = folder(["n8__LIDAR_TOP__1533151603547590.pcd.bin"], "samples/LIDAR_TOP")
    folder(
        [
            "n8__LIDAR_TOP__1533151603497690.pcd.bin",
            "n8__LIDAR_TOP__1533151603597490.pcd.bin",
        ],
        "sweeps/LIDAR_TOP",
    )
    sequence = open_sequence(root)
    assert sequence.info.layout == "nuScenes sweeps"
    stamps = [sequence[i].stamp for i in range(3)]
    np.testing.assert_allclose(
        np.array(stamps) - 1533151603, [0.49769, 0.54759, 0.59749], atol=1e-6
    )
    assert sequence[0].ring is not None
    assert sequence.rate_hz == pytest.approx(20, abs=0.1)


def test_a_jump_in_time_is_pointed_out(folder: Folder) -> None:
    names = [f"{1533151603 + second}{'000000'}.pcd.bin" for second in (0, 1, 2, 900)]
    assert "several drives" in open_sequence(folder(names)).info.warnings[0]


def test_labelled_layout(folder: Folder) -> None:
    root = folder(["000000.bin", "000001.bin"], "frames")
    (root / "labels").mkdir()
    instance = np.arange(200, dtype=np.int32) % 3
    for i in range(2):
        np.savez(
            root / "labels" / f"{i:06d}.npz",
            instance=instance,
            dynamic=instance == 2,
            foreground=instance > 0,
            annotated=instance < 2,
        )
    (root / "poses.txt").write_text(kitti_text(drive(2)))
    (root / "meta.json").write_text(json.dumps({"hz": 8, "times": [3.0, 3.125]}))
    box = {
        "id": 2,
        "category": "Car",
        "size_lwh": [4, 2, 1.5],
        "pose": np.eye(4).tolist(),
        "speed_mps": 5.0,
        "dynamic": True,
    }
    (root / "boxes.json").write_text(
        json.dumps([{"frame": 0, "time": 3.0, "boxes": []}, {"frame": 1, "boxes": [box]}])
    )
    sequence = open_sequence(root)
    assert sequence.has_labels
    assert sequence.poses is None
    assert (sequence.rate_hz, sequence[1].stamp) == (8.0, 3.125)
    labels = sequence.labels(1)
    np.testing.assert_array_equal(labels.instance, instance)
    np.testing.assert_array_equal(labels.annotated, instance < 2)
    np.testing.assert_allclose(labels.world_from_sensor, drive(2)[1], atol=1e-15)
    assert labels.boxes[0].category == "Car"
    assert sequence.labels(0).boxes == ()
    last = open_sequence(root, InputSettings(frames="1:"))
    assert last.labels(0).boxes[0].id == 2


def test_labels_follow_the_points_that_are_left(folder: Folder) -> None:
    root = folder(["000000.bin", "000001.bin"], "frames")
    table = np.fromfile(root / "frames" / "000001.bin", "<f4").reshape(-1, 4)
    table[5, 0] = np.nan
    table.tofile(root / "frames" / "000001.bin")
    (root / "labels").mkdir()
    np.savez(root / "labels" / "000001.npz", instance=np.arange(200, dtype=np.int32))
    sequence = open_sequence(root)
    np.testing.assert_array_equal(sequence.labels(1).instance, np.delete(np.arange(200), 5))
    assert sequence.counts.dropped == 1
    np.savez(root / "labels" / "000001.npz", instance=np.arange(199, dtype=np.int32))
    with pytest.raises(InputError, match="199 rows, the frame has 200"):
        open_sequence(root).labels(1)


def write_drive(path: Path, shuffled: bool = False) -> NDArray[np.float64]:
    """Three frames in one LAS file: by gps_time without gaps, point_source_id 4, 5, 9."""
    time = 1000.0 + np.arange(3000) * 1e-4
    rng = np.random.default_rng(0)
    if shuffled:
        time = rng.permutation(time)
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = [0.001] * 3
    las = laspy.LasData(header)
    las.x, las.y, las.z = rng.uniform(-30, 30, (3, 3000))
    las.gps_time = time
    las.point_source_id = np.array([4, 5, 9])[((time - 1000.0) / 0.1).astype(int)]
    las.write(path)
    return time


@pytest.mark.parametrize("shuffled", [False, True])
@pytest.mark.parametrize("split_by", ["point_source_id", "gps_time"])
def test_one_las_of_many_frames(tmp_path: Path, split_by: str, shuffled: bool) -> None:
    time = write_drive(tmp_path / "drive.laz", shuffled)
    sequence = open_sequence(tmp_path / "drive.laz", InputSettings(split_by=split_by))
    assert len(sequence) == 3
    for i in range(3):
        mine = time[(time >= 1000 + 0.1 * i - 1e-9) & (time < 1000.1 + 0.1 * i - 1e-9)]
        frame = sequence[i]
        np.testing.assert_array_equal(frame.attributes["gps_time"], mine)
        assert frame.stamp == pytest.approx(1000 + 0.1 * i)
        np.testing.assert_allclose(frame.time_offset, mine - frame.stamp, atol=1e-9)
    assert sequence.rate_hz == pytest.approx(10, rel=1e-3)
    assert sequence.info.times_from == "the points' own clock"


def test_gaps_in_gps_time_tell_frames_apart(tmp_path: Path) -> None:
    time = np.concatenate([50 + start + np.linspace(0, 0.07, 500) for start in (0, 0.13, 0.2, 0.5)])
    header = laspy.LasHeader(version="1.2", point_format=1)
    header.scales = [0.001] * 3
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.random.default_rng(0).uniform(-30, 30, (3, 2000))
    las.gps_time = time
    las.write(tmp_path / "drive.las")
    sequence = open_sequence(tmp_path / "drive.las", InputSettings(split_by="gps_time"))
    assert [len(sequence[i]) for i in range(len(sequence))] == [500, 1000, 500]


def test_splitting_by_what_is_not_there_is_said(tmp_path: Path, folder: Folder) -> None:
    write_drive(tmp_path / "drive.las")
    with pytest.raises(SettingsError, match="no dimension scan_number"):
        open_sequence(tmp_path / "drive.las", InputSettings(split_by="scan_number"))
    with pytest.raises(SettingsError, match="one LAS or LAZ file"):
        open_sequence(folder(["0.bin"]) / "0.bin", InputSettings(split_by="gps_time"))
    with pytest.raises(InputError, match="--split-by"):
        open_sequence(tmp_path / "drive.las").require_frames(2)


def test_unused_las_dimensions_are_no_attributes_unless_a_frame_uses_them(tmp_path: Path) -> None:
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = [0.001] * 3
    for i in range(3):
        las = laspy.LasData(header)
        las.x, las.y, las.z = np.random.default_rng(i).uniform(-30, 30, (3, 100))
        las.user_data = np.full(100, i)
        las.write(tmp_path / f"{i}.laz")
    sequence = open_sequence(tmp_path)
    assert [set(sequence[i].attributes) for i in range(3)] == [{"user_data"}] * 3
    shutil.rmtree(tmp_path)


def test_the_coordinate_system_is_known_without_reading_points(tmp_path: Path) -> None:
    wkt = 'LOCAL_CS["a street",UNIT["metre",1]]'
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", wkt.encode() + b"\0"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.random.default_rng(0).uniform(-30, 30, (3, 10))
    las.write(tmp_path / "0.laz")
    sequence = open_sequence(tmp_path)
    assert sequence.crs_wkt == wkt
    assert sequence.crs_vlrs[0].record_id == 2112


def test_bin_fields_must_name_a_position() -> None:
    with pytest.raises(SettingsError, match="lacks z"):
        InputSettings(bin_fields=("x", "y", "intensity"))
