"""A range image decodes to the points it was made from."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.io.driving.range_image import (
    LaserCalibration,
    Pixels,
    compensated,
    vehicle_points,
)

ROWS, COLUMNS = 8, 36


def image(seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    made = rng.uniform(0, 60, (ROWS, COLUMNS, 4)).astype("f4")
    made[rng.random((ROWS, COLUMNS)) < 0.3, 0] = -1
    return made


def calibration(yaw: float, values: np.ndarray | None = None) -> LaserCalibration:
    mount = rigid.exponential(np.array([0, 0, yaw, 0, 0, 0]))
    mount[:3, 3] = 1.4, 0.1, 2.0
    return LaserCalibration(mount, -0.3, 0.1, values)


def test_only_pixels_that_came_back_become_points() -> None:
    made = image()
    pixels = Pixels.of(made)
    assert len(pixels.row) == np.count_nonzero(made[..., 0] > 0)
    np.testing.assert_array_equal(pixels.values, made[pixels.row, pixels.column])


def test_distance_is_from_the_laser_and_columns_run_clockwise_from_behind() -> None:
    pixels, mount = Pixels.of(image()), calibration(2.6)
    away = vehicle_points(pixels, mount) - [1.4, 0.1, 2.0]
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), pixels.values[:, 0], rtol=1e-6)
    azimuth = np.degrees(np.arctan2(away[:, 1], away[:, 0]))
    np.testing.assert_allclose(azimuth, 180 - 10 * (pixels.column + 0.5), atol=1e-6)


def test_how_the_laser_is_turned_does_not_matter() -> None:
    pixels = Pixels.of(image())
    one, other = (vehicle_points(pixels, calibration(yaw)) for yaw in (0.0, -1.9))
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_beams_are_even_between_the_edges_unless_listed() -> None:
    even = calibration(0).inclinations_of_rows(ROWS)
    np.testing.assert_allclose(even, np.linspace(0.075, -0.275, ROWS), atol=1e-12)
    listed = np.sort(np.random.default_rng(1).uniform(-0.3, 0.1, ROWS))
    np.testing.assert_array_equal(calibration(0, listed).inclinations_of_rows(ROWS), listed[::-1])
    with pytest.raises(InputError, match="9"):
        calibration(0, np.zeros(9)).inclinations_of_rows(ROWS)


def test_the_poses_of_pixels_undo_the_vehicles_motion() -> None:
    """Roll, pitch and yaw of all sizes: the rotation is yaw times pitch times roll."""
    rng, pixels = np.random.default_rng(2), Pixels.of(image())
    angles = rng.uniform(-1, 1, (COLUMNS, 3))
    places = rng.uniform(-50, 50, (COLUMNS, 3))
    poses = np.broadcast_to(np.hstack([angles, places]), (ROWS, COLUMNS, 6)).astype("f4")
    frame = rigid.exponential(rng.normal(size=6))
    points = vehicle_points(pixels, calibration(0.5))
    expected = np.empty_like(points)
    for number, column in enumerate(pixels.column):
        motion = rigid.translation(places[column])
        for axis in (2, 1, 0):
            turn = np.zeros(6)
            turn[axis] = angles[column, axis]
            motion = motion @ rigid.exponential(turn)
        expected[number] = rigid.transform(
            rigid.invert(frame) @ motion, points[number : number + 1]
        )
    found = compensated(points, pixels, poses, frame)
    np.testing.assert_allclose(found, expected, atol=2e-5)
