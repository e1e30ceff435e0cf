"""What is given to a mover beside its obstacles."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from lidaraccum.data.accumulation import MOVING
from lidaraccum.data.frame import Frame
from lidaraccum.pipeline.association import Track
from lidaraccum.pipeline.motion_settings import BALANCED
from lidaraccum.pipeline.painting import Canvas
from lidaraccum.pipeline.sighting import Sighter

MOUNT_M = 1.7


def test_wheels_and_shoes_go_along_and_the_road_stays(busy_street: Any) -> None:
    x, y = (axis.ravel() for axis in np.mgrid[-20:20:0.3, -20:20:0.3])
    road = np.column_stack([x, y, np.zeros_like(x)])
    x, z = (axis.ravel() for axis in np.mgrid[6:10:0.05, 0.3:1.4:0.1])
    side = np.column_stack([x, np.full_like(x, 3.0), z])
    wheels = np.column_stack([np.linspace(6.5, 9.5, 30), np.full(30, 2.95), np.full(30, 0.09)])
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
    assert [part.mean() for part in parts] == [0.0, 1.0, 1.0, 0.0]
