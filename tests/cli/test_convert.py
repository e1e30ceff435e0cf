"""`lidaraccum convert`, through the user's door: what it writes, the other commands read."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import lidaraccum
from lidaraccum.geometry import rigid

KINDS = ("nuscenes", "waymo", "argoverse2")


@pytest.fixture(scope="module")
def pristine(logs: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Each data set on disk; not to be changed."""
    return {kind: logs.write(kind, tmp_path_factory.mktemp(kind)) for kind in KINDS}


@pytest.fixture
def spoilt(pristine: dict[str, Any], tmp_path: Path) -> Callable[[str], tuple[Path, str]]:
    """A copy of a data set that may be changed, and its log's name."""

    def copy(kind: str) -> tuple[Path, str]:
        root = tmp_path / f"source-{kind}"
        shutil.copytree(pristine[kind].root, root)
        return root, pristine[kind].name

    return copy


def refused(run: Any, kind: str, root: Path, *options: object, code: int = 3) -> str:
    """Run convert, check that it refused cleanly, and return what it said."""
    out = root.parent / "out"
    result = run("convert", kind, root, "-o", out, *options)
    assert result.exit_code == code, result.stderr
    assert result.stdout == ""
    assert not list(out.glob("*")), "something was written"
    said = [line for line in result.stderr.splitlines() if line.startswith("Error: ")]
    assert len(said) == 1, result.stderr
    return said[0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_log_can_be_accumulated_with_its_own_labels(
    run: Any, pristine: dict[str, Any], logs: ModuleType, kind: str, tmp_path: Path
) -> None:
    """A mover's points of all sweeps fill one body, where it was first, not a smear of several."""
    source, out = pristine[kind], tmp_path / "out"
    made = run("convert", kind, source.root, "-o", out)
    assert made.exit_code == 0, made.stderr
    assert source.name in made.stderr
    drive, cloud_file = out / source.name, tmp_path / "cloud.npz"
    result = run("accumulate", drive, "-o", cloud_file, "--method", "oracle", "--poses", "auto")
    assert result.exit_code == 0, result.stderr
    tracks = json.loads((drive / "meta.json").read_text())["tracks"]
    thing, number = logs.THINGS[logs.MOVER - 1], tracks.index("mover") + 1
    with np.load(cloud_file) as cloud:
        own = cloud["instance"] == number
        assert len(np.unique(cloud["frame"][own])) == len(source.seconds)
        assert set(cloud["label"][own]) == {2}
        first_from_world = rigid.invert(source.world_from_frame(0))
        box = first_from_world @ thing.at(source.seconds[0])
        local = rigid.transform(rigid.invert(box), cloud["points"][own])
    assert (np.abs(local) <= 0.45 * np.array(thing.size) + 0.03).all()
    way = np.hypot(*thing.velocity) * source.seconds[-1]
    assert way > 0.25 * thing.size[0], "the test asks for a mover that would leave a smear"


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_opens_with_everything_it_came_with(
    run: Any, pristine: dict[str, Any], kind: str, tmp_path: Path
) -> None:
    source = pristine[kind]
    result = run("convert", kind, source.root, "-o", tmp_path, "--log", source.name, "--json")
    assert result.exit_code == 0, result.stderr
    (said,) = json.loads(result.stdout)
    assert said == {
        "folder": str(tmp_path / source.name),
        "frames": len(source.seconds),
        "objects": 3,
        "moving": 2,
    }
    sequence = lidaraccum.open_sequence(tmp_path / source.name)
    assert set(sequence.label_fields) == {"instance", "dynamic", "foreground", "annotated"}
    for index in range(len(sequence)):
        frame, labels = sequence[index], sequence.labels(index)
        assert len(labels.instance) == len(frame)
        assert frame.ring is not None
        assert frame.intensity is not None
        # All three are compensated: a time per point would have it done again.
        assert frame.time_offset is None
    carried = {
        "nuscenes": set(),
        "waymo": {"elongation", "return_number"},
        "argoverse2": {"offset_ns"},
    }
    assert set(frame.attributes) == carried[kind]
    meta = json.loads((tmp_path / source.name / "meta.json").read_text())
    assert meta["licence"].startswith("Waymo" if kind == "waymo" else "CC BY-NC-SA")


def test_both_returns_and_no_label_zones_of_waymo(
    run: Any, pristine: dict[str, Any], tmp_path: Path
) -> None:
    source = pristine["waymo"]
    assert run("convert", "waymo", source.root, "-o", tmp_path).exit_code == 0
    sequence = lidaraccum.open_sequence(tmp_path / source.name)
    frame, labels, made = sequence[1], sequence.labels(1), source.truth(1)
    returns = [sequence[index].attributes["return_number"] for index in range(len(sequence))]
    assert [np.count_nonzero(one == 2) for one in returns] == [1, 1, 1, 0]
    second = returns[1] == 2
    np.testing.assert_allclose(frame.ranges[second], 30.0, atol=0.5)
    assert labels.annotated is not None
    np.testing.assert_array_equal(labels.annotated[~second], ~made.in_no_label_zone)
    assert 0 < made.in_no_label_zone.sum() < len(made.column)


@pytest.mark.parametrize("form", ["laz", "bin"])
def test_frames_of_another_format(
    run: Any, pristine: dict[str, Any], form: str, tmp_path: Path
) -> None:
    source = pristine["nuscenes"]
    result = run("convert", "nuscenes", source.root, "-o", tmp_path, "--format", form, "-q")
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    sequence = lidaraccum.open_sequence(tmp_path / source.name)
    np.testing.assert_allclose(
        sequence[3].points, source.truth(3).seen_from(source.world_from_frame(3)), atol=1e-3
    )


@pytest.mark.parametrize("kind", KINDS)
def test_a_dry_run_says_and_writes_nothing(
    run: Any, pristine: dict[str, Any], kind: str, tmp_path: Path
) -> None:
    source = pristine[kind]
    result = run("convert", kind, source.root, "-o", tmp_path / "out", "--dry-run")
    assert result.exit_code == 0
    assert result.stdout == f"would write {tmp_path / 'out' / source.name}\n"
    assert not (tmp_path / "out").exists()


def test_what_exists_is_not_replaced_unless_told(
    run: Any, pristine: dict[str, Any], tmp_path: Path
) -> None:
    source = pristine["argoverse2"]
    folder = tmp_path / source.name
    folder.mkdir()
    (folder / "mine").touch()
    words = ("convert", "argoverse2", source.root, "-o", tmp_path)
    result = run(*words)
    assert result.exit_code == 2
    assert "--overwrite" in result.stderr
    assert (folder / "mine").exists()
    assert run(*words, "--overwrite").exit_code == 0
    assert (folder / "frames").is_dir()
    assert not (folder / "mine").exists()


def test_a_single_argoverse_log_is_a_source_too(
    run: Any, pristine: dict[str, Any], tmp_path: Path
) -> None:
    source = pristine["argoverse2"]
    result = run("convert", "argoverse2", source.root / source.name, "-o", tmp_path)
    assert result.exit_code == 0, result.stderr
    assert (tmp_path / source.name / "boxes.json").exists()


@pytest.mark.parametrize("kind", KINDS)
def test_a_log_that_is_not_there(run: Any, spoilt: Any, kind: str) -> None:
    root, name = spoilt(kind)
    said = refused(run, kind, root, "--log", "scene-9999", code=2)
    assert "scene-9999" in said
    assert name in said


@pytest.mark.parametrize("kind", KINDS)
def test_a_folder_that_is_not_there(run: Any, tmp_path: Path, kind: str) -> None:
    assert "missing" in refused(run, kind, tmp_path / "missing")


@pytest.mark.parametrize(
    ("kind", "missing"),
    [
        ("nuscenes", "v1.0-mini/sample_annotation.json"),
        ("nuscenes", "v1.0-mini/ego_pose.json"),
        ("nuscenes", "sweeps/LIDAR_TOP/n008__LIDAR_TOP__1533151603050000.pcd.bin"),
        ("waymo", "lidar_box/NAME.parquet"),
        ("waymo", "lidar_pose/NAME.parquet"),
        ("waymo", "lidar_calibration/NAME.parquet"),
        ("argoverse2", "NAME/annotations.feather"),
        ("argoverse2", "NAME/city_SE3_egovehicle.feather"),
        ("argoverse2", "NAME/calibration/egovehicle_SE3_sensor.feather"),
    ],
)
def test_a_missing_table(run: Any, spoilt: Any, kind: str, missing: str) -> None:
    root, name = spoilt(kind)
    path = root / missing.replace("NAME", name)
    path.unlink()
    assert str(path) in refused(run, kind, root)


@pytest.mark.parametrize(
    ("component", "column"),
    [
        ("lidar", "[LiDARComponent].range_image_return2.values"),
        ("lidar_box", "[LiDARBoxComponent].box.heading"),
        ("vehicle_pose", "key.frame_timestamp_micros"),
    ],
)
def test_a_missing_column(run: Any, spoilt: Any, component: str, column: str) -> None:
    root, name = spoilt("waymo")
    path = root / component / f"{name}.parquet"
    pq.write_table(pq.read_table(path).drop([column]), path)
    said = refused(run, "waymo", root)
    assert column in said
    assert str(path) in said


def test_a_missing_key(run: Any, spoilt: Any) -> None:
    root, _ = spoilt("nuscenes")
    path = root / "v1.0-mini" / "sample_annotation.json"
    rows = [{k: v for k, v in row.items() if k != "size"} for row in json.loads(path.read_text())]
    path.write_text(json.dumps(rows))
    said = refused(run, "nuscenes", root)
    assert "size" in said
    assert str(path) in said


def test_a_truncated_sweep(run: Any, spoilt: Any) -> None:
    root, _ = spoilt("nuscenes")
    path = next((root / "samples" / "LIDAR_TOP").iterdir())
    path.write_bytes(path.read_bytes()[:-3])
    assert path.name in refused(run, "nuscenes", root)


def test_a_folder_above_the_splits_is_refused_with_a_split(run: Any, spoilt: Any) -> None:
    for kind in ("waymo", "argoverse2"):
        root, _ = spoilt(kind)
        above = root.parent / f"above-{kind}"
        above.mkdir()
        root.rename(above / "training")
        assert "training" in refused(run, kind, above)


def test_several_versions_must_be_told_apart(run: Any, spoilt: Any, tmp_path: Path) -> None:
    root, name = spoilt("nuscenes")
    shutil.copytree(root / "v1.0-mini", root / "v1.0-test")
    assert "--version" in refused(run, "nuscenes", root, code=2)
    assert "v1.0-mini" in refused(run, "nuscenes", root, "--version", "v1.0-trainval")
    result = run("convert", "nuscenes", root, "-o", tmp_path, "--version", "v1.0-mini")
    assert result.exit_code == 0, result.stderr
    assert (tmp_path / name).is_dir()


def test_a_version_is_nuscenes_alone(run: Any, spoilt: Any) -> None:
    root, _ = spoilt("waymo")
    assert "--version" in refused(run, "waymo", root, "--version", "v2.0.1", code=2)


def test_without_pyarrow_the_way_to_it_is_said(
    run: Any, spoilt: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    for kind in ("waymo", "argoverse2"):
        root, _ = spoilt(kind)
        assert "pip install" in refused(run, kind, root, code=1)


def test_an_unknown_data_set_is_a_usage_error(run: Any, tmp_path: Path) -> None:
    result = run("convert", "kitti", tmp_path, "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert "argoverse2" in result.stderr
