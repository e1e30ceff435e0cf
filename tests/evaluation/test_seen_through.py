"""What others saw through is moving; a still scene is not."""

from __future__ import annotations

import numpy as np

from lidaraccum.data.accumulation import MOVING
from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame, RegistrationQuality
from lidaraccum.evaluation.seen_through import SeenThrough

BEAMS, COLUMNS = 40, 720


def frame(index: int, car_x: float | None) -> RegisteredFrame:
    """A ring wall 20 m off on a plane, and a box 2 m wide before it where ``car_x`` says."""
    up = np.radians(np.linspace(-15, 5, BEAMS))[:, None]
    around = np.radians(np.arange(COLUMNS) * 360 / COLUMNS)[None]
    flat = np.broadcast_to(20.0, (BEAMS, COLUMNS)).copy()
    x_at_ten = 10.0 / np.tan(np.clip(around, 1e-3, np.pi - 1e-3))
    if car_x is not None:
        before = (around > 0.1) & (around < 3.0) & (np.abs(x_at_ten - car_x) < 1.0)
        low = np.abs(10.0 * np.tan(up) + 1.0) < 0.7
        reach = np.broadcast_to(10.0 / np.sin(np.clip(around, 0.1, 3.0)), flat.shape)
        flat = np.where(before & low, reach, flat)
    height = flat * np.tan(up)
    ground = height < -1.8
    flat = np.where(ground, -1.8 / np.tan(up), flat)
    height = np.where(ground, -1.8, height)
    points = np.stack([flat * np.cos(around), flat * np.sin(around), height], axis=-1)
    quality = RegistrationQuality("given", 1.0, 0.0)
    own = Frame(points.reshape(-1, 3).astype(np.float32), stamp=0.1 * index)
    return RegisteredFrame(index, own, np.eye(4), quality)


def moving(cars: list[float | None]) -> list[np.ndarray]:
    frames = [frame(index, car) for index, car in enumerate(cars)]
    seen = list(SeenThrough().perceive(iter(frames)))
    return [one.registered.frame.points[one.label == MOVING] for one in seen]


def test_a_still_scene_has_no_mover() -> None:
    assert [len(points) for points in moving([0.0] * 4)] == [0] * 4


def test_a_box_that_passes_is_found_where_it_is() -> None:
    for index, points in enumerate(moving([-4.0, -1.0, 2.0, 5.0])):
        assert len(points) > 20
        at = 10.0 * points[:, 0] / points[:, 1]
        assert np.abs(at - (3.0 * index - 4.0)).max() < 1.5
        assert points[:, 1].max() < 12.0
