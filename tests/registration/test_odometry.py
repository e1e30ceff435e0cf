"""Laws of odometry: right from the first pair, at any speed, and honest where it is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.registration.odometry import register
from lidaraccum.registration.settings import RegistrationSettings

REFINE = RegistrationSettings(poses_mode="refine")


def poses_of(registered: list[RegisteredFrame]) -> np.ndarray:
    return np.stack([frame.world_from_sensor for frame in registered])


def farthest(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm((found - truth)[:, :3, 3], axis=1).max())


@pytest.mark.parametrize(
    "twist",
    [
        [0, 0, 0, 1.3, 0, 0],
        [0, 0, 0, 3.0, 0, 0],
        [0, 0, 0, -2.0, 0, 0],
        [0, 0, 0, 0, 3.0, 0],
        [0, 0, 0, 0, -0.5, 0],
        [0, 0, 0.07, 1.0, 0, 0],
    ],
    ids=["13 m/s", "30 m/s", "backwards", "along y", "along -y", "40 deg/s"],
)
def test_first_steps_are_right_at_any_speed_and_axis(world: Any, twist: list[float]) -> None:
    moving = world.drive(twist, count=3)
    found = poses_of(list(register(moving.frames)))
    assert farthest(found, moving.poses) < 0.02


def test_two_hertz_at_town_speed(world: Any) -> None:
    moving = world.drive([0, 0, 0.2, 5.0, 0, 0], count=3)
    slow = [Frame(frame.points, stamp=0.5 * i) for i, frame in enumerate(moving.frames)]
    assert farthest(poses_of(list(register(slow))), moving.poses) < 0.05


def test_standing_still_is_identity(world: Any) -> None:
    still = world.drive([0] * 6, count=3)
    found = poses_of(list(register(still.frames)))
    np.testing.assert_allclose(found, np.tile(np.eye(4), (3, 1, 1)), atol=2e-3)


def test_a_sensor_lying_on_its_side(world: Any) -> None:
    moving = world.drive([0, 0, 0, 1.5, 0, 0], count=3)
    upright_from_lying = rigid.exponential([np.pi / 2, 0, 0, 0, 0, 0])
    lying = [
        Frame(rigid.transform(upright_from_lying, frame.points).astype(np.float32), frame.stamp)
        for frame in moving.frames
    ]
    truth = upright_from_lying @ moving.poses @ rigid.invert(upright_from_lying)
    assert farthest(poses_of(list(register(lying))), truth) < 0.03


def test_order_of_points_does_not_matter(world: Any, straight: Any) -> None:
    pairs = [world.shuffled(frame, i) for i, frame in enumerate(straight.frames[:4])]
    plain = list(register(straight.frames[:4]))
    mixed = list(register([frame for frame, _ in pairs]))
    np.testing.assert_allclose(poses_of(mixed), poses_of(plain), atol=1e-6)
    for (_, order), one, other in zip(pairs, plain, mixed, strict=True):
        np.testing.assert_array_equal(other.frame.points, one.frame.points[order])


def test_moving_the_sensor_coordinates_moves_the_answer(straight: Any) -> None:
    new_from_old = rigid.exponential([0.05, -0.03, 1.0, 0.5, -0.2, 0.3])
    moved = [
        Frame(rigid.transform(new_from_old, frame.points).astype(np.float32), frame.stamp)
        for frame in straight.frames[:4]
    ]
    truth = new_from_old @ straight.poses[:4] @ rigid.invert(new_from_old)
    assert farthest(poses_of(list(register(moved))), truth) < 0.02


def test_every_frame_leaves_once_in_order(straight: Any) -> None:
    registered = list(register(iter(straight.frames)))
    assert [frame.index for frame in registered] == list(range(len(straight.frames)))
    for one, raw in zip(registered, straight.frames, strict=True):
        assert len(one.frame) == len(raw)


def test_a_frame_leaves_before_the_next_but_one_is_read(straight: Any) -> None:
    read = 0

    def stream() -> Any:
        nonlocal read
        for frame in straight.frames:
            read += 1
            yield frame

    for registered in register(stream()):
        assert read <= max(RegistrationSettings().lookahead, registered.index + 1)


def test_one_frame_is_the_world() -> None:
    points = np.random.default_rng(0).uniform(-20, 20, (500, 3)).astype(np.float32)
    (only,) = register([Frame(points)])
    np.testing.assert_array_equal(only.world_from_sensor, np.eye(4))


def test_no_return_points_stay_where_they_are(rolling: Any) -> None:
    frames = [
        Frame(
            np.vstack([np.zeros((50, 3), np.float32), frame.points]),
            stamp=frame.stamp,
            time_offset=np.concatenate([np.zeros(50, np.float32), frame.time_offset]),
        )
        for frame in rolling.frames
    ]
    registered = list(register(frames))
    assert all(not frame.frame.points[:50].any() for frame in registered)
    assert farthest(poses_of(registered), rolling.poses) < 0.03


def test_given_poses_come_back_unchanged(straight: Any) -> None:
    given = rigid.translation((100.0, 5.0, 2.0)) @ straight.poses
    registered = list(register(straight.frames, given=given))
    np.testing.assert_array_equal(poses_of(registered), given)
    assert not any(frame.quality.doubts for frame in registered)
    assert registered[3].quality.hypothesis == "given"


def test_wrong_given_poses_are_doubted(straight: Any) -> None:
    given = straight.poses.copy()
    given[7:, :3, 3] += 3.0
    registered = list(register(straight.frames, given=given))
    assert registered[7].quality.doubts


@pytest.mark.parametrize("mistake", ["all identity", "inverted"])
def test_poses_of_something_else_are_doubted_at_once(straight: Any, mistake: str) -> None:
    wrong = {
        "all identity": np.tile(np.eye(4), (len(straight.poses), 1, 1)),
        "inverted": rigid.invert(straight.poses),
    }
    registered = list(register(straight.frames, given=wrong[mistake]))
    assert "other than the given poses" in registered[1].quality.doubts[-1]


def test_rough_given_poses_are_refined(straight: Any) -> None:
    given = straight.poses.copy()
    given[1:, :3, 3] += np.random.default_rng(4).normal(0, 0.1, (len(given) - 1, 3))
    found = poses_of(list(register(straight.frames, REFINE, given=given)))
    assert farthest(found, straight.poses) < 0.02


@pytest.mark.parametrize("count", [3, 20])
def test_poses_must_be_as_many_as_frames(straight: Any, count: int) -> None:
    given = np.tile(np.eye(4), (count, 1, 1))
    with pytest.raises(InputError, match=f"{count} poses"):
        list(register(straight.frames, given=given))


def test_a_frame_from_elsewhere_is_doubted_and_survived(world: Any, straight: Any) -> None:
    elsewhere = world.drive([0] * 6, count=1, scene=world.street(7)).frames[0]
    frames = list(straight.frames)
    frames[7] = Frame(elsewhere.points, stamp=frames[7].stamp)
    registered = list(register(frames))
    assert registered[7].quality.doubts
    assert not any(frame.quality.doubts for frame in registered[8:])
    assert farthest(poses_of(registered)[8:], straight.poses[8:]) < 0.02


def test_a_missing_frame_is_bridged(straight: Any) -> None:
    kept = [i for i in range(12) if i not in (6, 7)]
    found = poses_of(list(register([straight.frames[i] for i in kept])))
    assert farthest(found, straight.poses[kept]) < 0.02


def test_a_smooth_tunnel_is_doubted() -> None:
    random = np.random.default_rng(2)
    frames = []
    for index in range(4):
        angle, along = random.uniform(-np.pi, np.pi, 8000), random.uniform(-40, 40, 8000)
        tube = np.stack([along, 4 * np.cos(angle), 3 * np.sin(angle)], axis=1)
        frames.append(Frame(tube.astype(np.float32), stamp=0.1 * index))
    registered = list(register(frames))
    assert all(frame.quality.doubts for frame in registered[1:])


def test_masked_points_have_no_say(straight: Any) -> None:
    def with_passenger(frame: Frame) -> Frame:
        block = np.random.default_rng(1).uniform([8, -6, -1.5], [14, 6, 3], (6000, 3))
        return Frame(np.vstack([frame.points, block.astype(np.float32)]), stamp=frame.stamp)

    def is_street(frame: Frame) -> np.ndarray:
        return np.arange(len(frame)) < len(frame) - 6000

    frames = [with_passenger(frame) for frame in straight.frames[:4]]
    registered = list(register(frames, static_mask=is_street))
    assert farthest(poses_of(registered), straight.poses[:4]) < 0.02


def test_georeferenced_frames_are_known_to_be_aligned(straight: Any) -> None:
    frames, origins = [], []
    for frame, pose in zip(straight.frames[:4], straight.poses, strict=False):
        world_points = rigid.transform(pose, frame.points) + np.array([4e5, 5e6, 100.0])
        origin = np.floor(world_points.mean(axis=0))
        origins.append(origin)
        local = (world_points - origin).astype(np.float32)
        frames.append(Frame(local, stamp=frame.stamp, origin=origin))
    found = poses_of(list(register(frames)))
    truth = np.stack([rigid.translation(origin - origins[0]) for origin in origins])
    assert farthest(found, truth) < 0.02
