"""`lidaraccum mesh`, through the user's door, on what accumulate wrote."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plyfile import PlyData


@pytest.fixture
def cloud(run: Any, bins: Path, tmp_path: Path) -> Path:
    out = tmp_path / "out.ply"
    assert run("accumulate", bins, "-o", out).exit_code == 0
    return out


def test_the_ground_is_where_it_was_and_faces_up(run: Any, cloud: Path, tmp_path: Path) -> None:
    result = run("mesh", cloud, "-o", tmp_path / "mesh.ply", "--depth", 8, "--json")
    assert result.exit_code == 0, result.stderr
    vertex = PlyData.read(tmp_path / "mesh.ply")["vertex"]
    assert json.loads(result.stdout)["vertices"] == len(vertex)
    xyz = np.column_stack([vertex[axis] for axis in "xyz"])
    street = (np.abs(xyz[:, 1]) < 3) & (np.abs(xyz[:, 0]) < 8)
    assert np.count_nonzero(street) > 100
    assert np.median(np.abs(xyz[street, 2] + 1.8)) < 0.05
    assert np.median(vertex["nz"][street]) > 0.9


def test_an_object_that_is_not_there(run: Any, cloud: Path, tmp_path: Path) -> None:
    result = run("mesh", cloud, "-o", tmp_path / "mesh.ply", "--instance", 5)
    assert result.exit_code == 3
    assert "instance 5" in result.stderr
    assert not (tmp_path / "mesh.ply").exists()


def test_an_unknown_format(run: Any, cloud: Path, tmp_path: Path) -> None:
    result = run("mesh", cloud, "-o", tmp_path / "mesh.xyz")
    assert result.exit_code == 2
    assert ".obj" in result.stderr


def test_a_mesh_is_not_replaced_unless_told(run: Any, cloud: Path, tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.ply"
    mesh.write_text("precious")
    assert run("mesh", cloud, "-o", mesh).exit_code == 2
    assert mesh.read_text() == "precious"


def test_no_cloud(run: Any, tmp_path: Path) -> None:
    result = run("mesh", tmp_path / "missing.ply", "-o", tmp_path / "mesh.ply")
    assert result.exit_code == 3
    assert "missing.ply" in result.stderr


def test_without_poses_beside_it_the_user_is_told(run: Any, cloud: Path, tmp_path: Path) -> None:
    (tmp_path / "out.poses.txt").unlink()
    result = run("mesh", cloud, "-o", tmp_path / "mesh.obj", "--depth", 6)
    assert result.exit_code == 0, result.stderr
    assert "out.poses.txt is not there" in result.stderr
