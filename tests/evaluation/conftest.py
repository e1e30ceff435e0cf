"""A drive made by hand, in which everything is known, and one that is simulated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from lidaraccum.data.accumulation import MOVING, AccumulatedFrame
from lidaraccum.data.frame import Box, Frame, Labels
from lidaraccum.evaluation.truth import WindowTruth
from lidaraccum.geometry import rigid

CAR, WALKER = 7, 9
WALL = np.array([[5.0, 2.0, 0.0], [8.0, -3.0, 1.0], [40.0, 0.0, 0.0]])
BODY = np.array([[0.5, 0.0, 0.2], [-0.5, 0.3, 0.4]])


@dataclass
class HandMade:
    """The sensor drives 1 m a frame along x; a car goes 2 m a frame along y; a walker hides.

    Points of each frame: three of a wall (the third 40 m ahead at the start), two of the car, then
    one of the walker, which frame 0 does not show. ``changes`` are to the labels, by frame.
    """

    name: str = "hand-made"
    rate_hz: float = 10.0
    poses: None = None
    crs_wkt: None = None
    frames: int = 3
    changes: dict[int, dict[str, np.ndarray]] = field(default_factory=dict)

    def __len__(self) -> int:
        return self.frames

    def pose(self, index: int) -> np.ndarray:
        return rigid.translation((float(index), 0.0, 0.0))

    def car(self, index: int) -> np.ndarray:
        return rigid.translation((6.0, 2.0 * index, 0.0))

    def _world(self, index: int) -> np.ndarray:
        walker = np.array([[3.0, 0.1 * index, 0.0]])
        parts = [WALL, rigid.transform(self.car(index), BODY), walker]
        return np.concatenate(parts if index else parts[:2])

    def __getitem__(self, index: int, /) -> Frame:
        own = rigid.transform(rigid.invert(self.pose(index)), self._world(index))
        return Frame(own.astype(np.float32), stamp=0.1 * index)

    def labels(self, index: int, /) -> Labels:
        instance = np.array([0, 0, 0, CAR, CAR, WALKER][: len(self[index])], dtype=np.int32)
        sensor_from_world = rigid.invert(self.pose(index))
        boxes = (
            Box(CAR, "Car", (1, 1, 1), sensor_from_world @ self.car(index), 20.0, True),
            Box(WALKER, "Pedestrian", (1, 1, 2), sensor_from_world @ np.eye(4), 1.0, True),
        )
        labels = Labels(self.pose(index), instance > 0, instance > 0, instance, boxes)
        return replace(labels, **self.changes.get(index, {}))


@pytest.fixture
def hand_made() -> HandMade:
    return HandMade()


def put_right(truth: WindowTruth, shift: float = 0.0) -> list[AccumulatedFrame]:
    """The true answer, all but the target's points off by a shift along z."""
    frames = []
    for index, frame in enumerate(truth.frames):
        count = len(frame.known)
        points = frame.in_target + np.array([0.0, 0.0, shift if index else 0.0])
        frames.append(
            AccumulatedFrame(
                index=index,
                points=points,
                rows=np.arange(count),
                row_count=count,
                label=np.where(frame.dynamic, MOVING, 0).astype(np.uint8),
                instance=frame.instance,
                confidence=np.ones(count, dtype=np.float32),
                time=np.zeros(count),
                range_m=np.ones(count, dtype=np.float32),
                stamp=0.1 * index,
                reference_from_sensor=truth.poses[index],
                attributes={},
            )
        )
    return frames


@pytest.fixture
def placed() -> Callable[..., list[AccumulatedFrame]]:
    """`placed(truth, shift=0)`: frames as `put_right` makes them."""
    return put_right


@pytest.fixture(scope="session")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated street with movers, no rolling shutter, as a labelled folder of six frames."""
    from lidaraccum.io.labelled import write_labelled_sequence
    from lidaraccum.simulation.drive import DriveSettings, simulate

    folder = tmp_path_factory.mktemp("drives") / "street"
    settings = DriveSettings(
        seed=8, frames=6, sensor="VLP-16", speed_mps=6.0, rolling_shutter=False
    )
    write_labelled_sequence(folder, simulate(settings))
    return folder
