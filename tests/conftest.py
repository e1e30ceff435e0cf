"""A small street that every test can drive down: boxes on a plane, cast ray by ray."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from click.testing import CliRunner, Result

from lidaraccum.geometry import rigid

SENSOR_HEIGHT_M = 1.8
STEP_M = 0.9
RATE_HZ = 10.0


@dataclass(frozen=True)
class Street:
    """Axis-aligned boxes on the plane z = 0.

    Attributes:
        low: (B, 3) lower corners, metres.
        high: (B, 3) upper corners, metres.
    """

    low: np.ndarray
    high: np.ndarray

    @classmethod
    def random(cls, seed: int = 3) -> Street:
        """House fronts with gaps on both sides, parked things before them."""
        rng = np.random.default_rng(seed)
        low, high = [], []
        for side in (-1, 1):
            x = -60.0
            while x < 80:
                length, depth = rng.uniform(4, 11), rng.uniform(3, 8)
                near = rng.uniform(7, 11)
                y = sorted((side * near, side * (near + depth)))
                low.append([x, y[0], 0])
                high.append([x + length, y[1], rng.uniform(3, 9)])
                if rng.random() < 0.7:
                    beside = sorted((side * 4.6, side * 6.4))
                    start = x + rng.uniform(0, 3)
                    low.append([start, beside[0], 0.2])
                    high.append([start + rng.uniform(0.5, 4.5), beside[1], rng.uniform(0.8, 2)])
                x += length + rng.uniform(0.5, 4)
        return cls(np.array(low), np.array(high))

    def cast(
        self, world_from_sensor: np.ndarray, beams: int = 24, columns: int = 540
    ) -> np.ndarray:
        """(N, 3) float32 points in sensor coordinates, nearest hits within 70 m, in beam order."""
        elevation = np.radians(np.linspace(-22, 8, beams))
        azimuth = np.radians(np.arange(columns) * 360 / columns)
        up, around = np.meshgrid(elevation, azimuth, indexing="ij")
        rays = np.stack(
            [np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1
        ).reshape(-1, 3)
        start = world_from_sensor[:3, 3]
        directions = rays @ world_from_sensor[:3, :3].T
        with np.errstate(divide="ignore"):
            inverse = 1.0 / directions
        nearest = np.where(directions[:, 2] < 0, -start[2] * inverse[:, 2], np.inf)
        for low, high in zip(self.low, self.high, strict=True):
            first, second = (low - start) * inverse, (high - start) * inverse
            enter = np.minimum(first, second).max(axis=1)
            leave = np.maximum(first, second).min(axis=1)
            nearest = np.where((enter <= leave) & (enter > 0), np.minimum(nearest, enter), nearest)
        hit = nearest < 70
        return (rays[hit] * nearest[hit, None]).astype(np.float32)


@dataclass(frozen=True)
class Drive:
    """Frames of a drive down the street and where the sensor truly was.

    Attributes:
        frames: (N, 3) float32 points in sensor coordinates, a frame each.
        world_from_sensor: (T, 4, 4).
    """

    frames: list[np.ndarray]
    world_from_sensor: np.ndarray

    @property
    def first_from_frame(self) -> np.ndarray:
        """(T, 4, 4) poses in the first frame's sensor coordinates."""
        return rigid.invert(self.world_from_sensor[0]) @ self.world_from_sensor


def _pose(index: int) -> np.ndarray:
    pose = rigid.exponential(np.array([0, 0, 0.012 * index, 0, 0, 0]))
    pose[:3, 3] = [STEP_M * index, 0.03 * index, SENSOR_HEIGHT_M]
    return pose


@pytest.fixture(scope="session")
def drive() -> Drive:
    """Six frames at 9 m/s, no rolling shutter, 1 cm of noise."""
    street, rng = Street.random(), np.random.default_rng(0)
    poses = np.stack([_pose(index) for index in range(6)])
    clean = [street.cast(pose) for pose in poses]
    noisy = [points + rng.normal(0, 0.01, points.shape).astype(np.float32) for points in clean]
    return Drive(noisy, poses)


def write_bins(folder: Path, frames: list[np.ndarray]) -> Path:
    """KITTI .bin files: x y z and an intensity that tells the points apart."""
    folder.mkdir(parents=True, exist_ok=True)
    for index, points in enumerate(frames):
        intensity = np.linspace(0, 1, len(points), dtype=np.float32)
        np.column_stack([points, intensity]).astype("<f4").tofile(folder / f"frame_{index}.bin")
    return folder


@pytest.fixture
def bins(drive: Drive, tmp_path: Path) -> Path:
    """The drive as a folder of .bin files."""
    return write_bins(tmp_path / "seq", drive.frames)


Run = Callable[..., Result]


@pytest.fixture(autouse=True)
def without_shipped_weights(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An installation without weights, but for tests marked ``shipped``.

    What has no part of the network in it should not take the network's time.
    """
    if request.node.get_closest_marker("shipped") is None:
        monkeypatch.setattr("lidaraccum.model.weights.shipped_weights", lambda: None)


@pytest.fixture
def run() -> Run:
    """`lidaraccum ARGS` as a user would enter it; the result has exit_code, stdout, stderr."""
    from lidaraccum.cli.main import cli

    def invoke(
        *args: object, stdin: str | None = None, env: dict[str, str] | None = None
    ) -> Result:
        return CliRunner().invoke(cli, [str(arg) for arg in args], input=stdin, env=env)

    return invoke


@pytest.fixture(scope="session")
def logs() -> ModuleType:
    """The package that writes the made-up street as each data set would have recorded it."""
    package = Path(__file__).parent / "io" / "driving" / "driving_logs"
    spec = importlib.util.spec_from_file_location(
        package.name, package / "__init__.py", submodule_search_locations=[str(package)]
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[package.name] = module
    spec.loader.exec_module(module)
    return module
