"""Laws of the motion within a sweep: undone where it is there, left alone where it is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid
from lidaraccum.registration.deskew import transform_along, turn_fractions
from lidaraccum.registration.firing import Seam, is_as_measured, seam_of_file_order
from lidaraccum.registration.odometry import register
from lidaraccum.registration.settings import RegistrationSettings

TWIST = np.array([0, 0, 0.04, 1.2, 0, 0])


def without_times(frames: list[Frame]) -> list[Frame]:
    return [Frame(frame.points, stamp=frame.stamp) for frame in frames]


def straight_points(frame: Frame, interval_s: float) -> np.ndarray:
    assert frame.time_offset is not None
    return transform_along(TWIST, frame.time_offset / interval_s, frame.points)


def test_each_point_moves_by_its_own_part() -> None:
    random = np.random.default_rng(3)
    twist, points = random.normal(size=6), random.normal(size=(40, 3)) * 20
    fractions = random.uniform(-0.5, 0.5, 40)
    motions = rigid.exponentials(twist[None], fractions)
    one_by_one = [
        rigid.transform(motion, point[None])[0]
        for motion, point in zip(motions, points, strict=True)
    ]
    np.testing.assert_allclose(transform_along(twist, fractions, points), one_by_one, atol=1e-9)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_turn_starts_and_ends_at_the_seam(direction: int) -> None:
    seam = Seam(np.pi / 2, direction)
    around = seam.azimuth_rad + direction * 2 * np.pi * np.array([0.001, 0.25, 0.5, 0.999])
    points = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    np.testing.assert_allclose(turn_fractions(points, seam), [-0.499, -0.25, 0, 0.499], atol=1e-9)


@pytest.mark.parametrize("times", [True, False], ids=["times", "azimuth"])
def test_a_rolling_sweep_comes_out_straight(world: Any, rolling: Any, times: bool) -> None:
    frames = rolling.frames if times else without_times(rolling.frames)
    registered = list(register(frames))
    assert all(frame.deskewed for frame in registered)
    for one, raw, pose in zip(registered, rolling.frames, rolling.poses, strict=True):
        assert np.linalg.norm(one.world_from_sensor[:3, 3] - pose[:3, 3]) < 0.03
        truth = straight_points(raw, world.interval_s)
        off = np.linalg.norm(one.frame.points - truth, axis=1)
        assert np.median(off) < 0.02
        assert one.seconds_from_stamp is not None
        np.testing.assert_allclose(
            np.median(one.seconds_from_stamp - raw.time_offset), 0, atol=1e-3
        )


@pytest.mark.parametrize("times", [True, False], ids=["times", "no times"])
def test_a_compensated_sweep_is_not_bent(world: Any, rolling: Any, times: bool) -> None:
    frames = world.compensated(rolling, TWIST, times=times)
    registered = list(register(frames))
    assert not any(frame.deskewed for frame in registered)
    np.testing.assert_array_equal(registered[2].frame.points, frames[2].points)
    seconds = registered[2].seconds_from_stamp
    assert (seconds is not None) == times
    if seconds is not None:
        np.testing.assert_array_equal(seconds, frames[2].time_offset)


@pytest.mark.parametrize("measured", [True, False], ids=["measured", "compensated"])
def test_times_are_heeded_in_a_vehicle_s_coordinates_too(
    world: Any, rolling: Any, measured: bool
) -> None:
    """Seen from elsewhere than the sensor's place, equal steps of azimuth are not equal."""
    frames = rolling.frames if measured else world.compensated(rolling, TWIST, times=True)
    arm = np.array([1.4, 0.3, 1.8], dtype=np.float32)
    elsewhere = [frame.with_points(frame.points + arm) for frame in frames]
    assert all(frame.deskewed == measured for frame in register(elsewhere))


def test_a_sweep_at_one_time_is_not_bent(straight: Any) -> None:
    assert not any(frame.deskewed for frame in register(straight.frames[:6]))


def test_deskew_off_leaves_points_alone(rolling: Any) -> None:
    registered = list(register(rolling.frames, RegistrationSettings(deskew="off")))
    for one, raw in zip(registered, rolling.frames, strict=True):
        np.testing.assert_array_equal(one.frame.points, raw.points)
        assert one.seconds_from_stamp is None


def test_spacing_tells_measured_from_compensated(world: Any, rolling: Any) -> None:
    measured = rolling.frames[2].points
    undone = world.compensated(rolling, TWIST, times=True)[2].points
    assert is_as_measured(measured, TWIST) is True
    assert is_as_measured(undone, TWIST) is False


def test_spacing_does_not_depend_on_order(world: Any, rolling: Any) -> None:
    mixed, _ = world.shuffled(rolling.frames[2], 5)
    assert is_as_measured(mixed.points, TWIST) is True


def test_scattered_points_say_nothing_of_sweeps() -> None:
    scattered = np.random.default_rng(0).uniform(-30, 30, (20000, 3)).astype(np.float32)
    assert is_as_measured(scattered, TWIST) is None


def test_file_order_names_the_seam(world: Any, rolling: Any) -> None:
    seam = seam_of_file_order(rolling.frames[0].points)
    assert seam is not None
    assert seam.direction == -1
    assert abs(np.cos(seam.azimuth_rad) + 1) < 1e-3
    assert seam_of_file_order(world.shuffled(rolling.frames[0], 1)[0].points) is None
