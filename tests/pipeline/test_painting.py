"""What is given to a mover beside its obstacles."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.accumulation import MOVING
from lidaraccum.data.frame import Frame
from lidaraccum.pipeline.association import Track
from lidaraccum.pipeline.motion_settings import BALANCED
from lidaraccum.pipeline.painting import Canvas
from lidaraccum.pipeline.sighting import Sighter

MOUNT_M = 1.7


@pytest.mark.parametrize(
    ("bumps_m", "foot_m", "goes"),
    [(0.0, 0.09, True), (0.0, 0.06, True), (0.06, 0.06, False), (0.06, 0.09, True)],
)
def test_wheels_and_shoes_go_along_where_they_stand_out_of_the_road(
    busy_street: Any, bumps_m: float, foot_m: float, goes: bool
) -> None:
    x, y = (axis.ravel() for axis in np.mgrid[-20:20:0.3, -20:20:0.3])
    bumps = np.where(np.arange(x.size) % 5 == 0, bumps_m, 0.0)
    road = np.column_stack([x, y, bumps])
    x, z = (axis.ravel() for axis in np.mgrid[6:10:0.05, 0.3:1.4:0.1])
    side = np.column_stack([x, np.full_like(x, 3.0), z])
    wheels = np.column_stack([np.linspace(6.5, 9.5, 30), np.full(30, 2.95), np.full(30, foot_m)])
    beside = wheels + np.array([0.0, 1.5, 0.0])
    points = np.concatenate([road, side, wheels, beside]) - np.array([0.0, 0.0, MOUNT_M])
    first = busy_street.frames[0]
    measured = Frame(points.astype(np.float32), first.frame.stamp)
    frame = Sighter(BALANCED)(replace(first, frame=measured))
    assert len(frame.rows) == len(side)

    canvas = Canvas(frame)
    track = Track(7, np.array([5.0, 0.0, 0.0]), np.array([8.0, 3.0, 0.0]), first.frame.stamp)
    canvas.paint(track, np.arange(len(frame.rows)), MOVING)

    told = canvas.perceived().instance == 7
    parts = np.split(told, np.cumsum([len(road), len(side), len(wheels)]))
    assert [part.mean() for part in parts] == [0.0, 1.0, float(goes), 0.0]
