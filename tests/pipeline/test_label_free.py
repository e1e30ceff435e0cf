"""Movers are found, whole and in place; nothing else is; how it was asked does not matter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.accumulation import BACKGROUND, MOVING, STILL
from lidaraccum.data.frame import Frame
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.errors import SettingsError
from lidaraccum.geometry import rigid
from lidaraccum.pipeline.label_free import LabelFree
from lidaraccum.pipeline.motion_settings import AGGRESSIVE, BALANCED, CONSERVATIVE, MotionSettings


def perceive(
    frames: list[RegisteredFrame], settings: MotionSettings = BALANCED
) -> list[PerceivedFrame]:
    return list(LabelFree(settings).perceive(frames))


@pytest.fixture(scope="module")
def busy(busy_street: Any) -> list[PerceivedFrame]:
    return perceive(busy_street.frames)


def test_movers_are_found_and_nothing_else(busy: list[PerceivedFrame], busy_street: Any) -> None:
    said = np.concatenate([frame.label == MOVING for frame in busy])
    true = np.concatenate(busy_street.on) > 0
    assert (said & true).sum() > 0.95 * true.sum()
    assert (said & ~true).sum() < 0.02 * true.sum()


@pytest.mark.parametrize("mover", [1, 2])
def test_a_mover_keeps_one_id(busy: list[PerceivedFrame], busy_street: Any, mover: int) -> None:
    ids = np.concatenate(
        [frame.instance[on == mover] for frame, on in zip(busy, busy_street.on, strict=True)]
    )
    counts = np.bincount(ids)
    assert counts.max() > 0.9 * len(ids)
    assert counts.argmax() > 0


def test_a_mover_is_moved_as_it_moved(busy: list[PerceivedFrame], busy_street: Any) -> None:
    car = int(np.bincount(busy[4].instance[busy_street.on[4] == 1]).argmax())
    first, last = busy[1].world_from_object[car], busy[7].world_from_object[car]
    assert np.allclose((last @ rigid.invert(first))[:3, 3], [-4.8, 0, 0], atol=0.15)


def test_the_edge_of_a_roof_over_a_nearer_car_does_not_go_along(look: Any) -> None:
    """What shows of it past the nearer roof goes as the sensor does, and is seen past later."""
    for frame in perceive(look(count=26, speed=3.0).frames):
        assert (frame.label == BACKGROUND).all()


def test_a_still_scene_with_noise_does_not_move(look: Any) -> None:
    for frame in perceive(look(noise=0.03).frames):
        assert (frame.label == BACKGROUND).all()
        assert not frame.world_from_object


def test_what_a_mover_hides_and_uncovers_stands_still(look: Any, new_mover: Any) -> None:
    passing = new_mover(low=(4.0, 1.9, 0.1), size=(5.0, 1.8, 2.4), velocity=(9.0, 0.0, 0.0))
    street = look([passing], speed=2.0)
    for frame, on in zip(perceive(street.frames), street.on, strict=True):
        assert ((frame.label == MOVING) & (on == 0)).sum() < 0.02 * (on == 1).sum()


def test_order_of_points_changes_nothing(busy: list[PerceivedFrame], busy_street: Any) -> None:
    rng = np.random.default_rng(1)
    orders = [rng.permutation(len(registered.frame)) for registered in busy_street.frames]
    shuffled = [
        replace(registered, frame=registered.frame.with_points(registered.frame.points[order]))
        for registered, order in zip(
            (replace(r, frame=Frame(r.frame.points, r.frame.stamp)) for r in busy_street.frames),
            orders,
            strict=True,
        )
    ]
    for frame, again, order in zip(busy, perceive(shuffled), orders, strict=True):
        assert (frame.label[order] == again.label).all()
        assert (frame.instance[order] == again.instance).all()


def test_moving_the_world_moves_the_answer(busy: list[PerceivedFrame], busy_street: Any) -> None:
    other_from_world = rigid.exponential(np.array([0, 0, 1.1, 40.0, -7.0, 3.0]))
    elsewhere = [
        replace(registered, world_from_sensor=other_from_world @ registered.world_from_sensor)
        for registered in busy_street.frames
    ]
    for frame, again in zip(busy, perceive(elsewhere), strict=True):
        assert (frame.label == again.label).mean() > 0.999
        for instance, pose in frame.world_from_object.items():
            moved = again.world_from_object[instance]
            assert np.allclose(moved[:3, 3], (other_from_world @ pose)[:3, 3], atol=0.03)


def test_what_stops_is_movable_but_still(look: Any, new_mover: Any) -> None:
    stopping = new_mover(
        low=(14.0, -4.5, 0.15), size=(4.2, 1.8, 1.45), velocity=(-6.0, 0.0, 0.0), stops_after_s=0.8
    )
    street = look([stopping], count=16, speed=2.0)
    frames = perceive(street.frames)
    car = int(np.bincount(frames[4].instance[street.on[4] == 1]).argmax())
    last = frames[-1].label[street.on[-1] == 1]
    assert (frames[4].label[street.on[4] == 1] == MOVING).mean() > 0.9
    assert (last == STILL).mean() > 0.8
    assert (frames[-1].instance[street.on[-1] == 1] == car).mean() > 0.8


def doubted(frames: list[RegisteredFrame]) -> list[RegisteredFrame]:
    return [
        replace(frame, quality=replace(frame.quality, doubts=("it slipped",))) for frame in frames
    ]


def test_a_doubt_alone_hides_no_mover(busy: list[PerceivedFrame], busy_street: Any) -> None:
    for frame, again in zip(busy, perceive(doubted(busy_street.frames)), strict=True):
        assert (frame.label == again.label).all()


@pytest.mark.parametrize("shift", [(1.0, 0.0, 0.0), (0.3, 0.9, 0.0), (3.0, -2.0, 0.0)])
def test_where_a_pose_slipped_nothing_that_stands_moves(
    look: Any, shift: tuple[float, float, float]
) -> None:
    slip = rigid.translation(shift)
    frames = [
        replace(frame, world_from_sensor=slip @ frame.world_from_sensor) if place > 3 else frame
        for place, frame in enumerate(look().frames)
    ]
    for frame in perceive(doubted(frames)):
        assert (frame.label == MOVING).mean() < 0.02


def test_where_poses_make_most_of_the_scene_move_it_stands(look: Any) -> None:
    """The sensor drove at 6 m/s and is said to have stood: all it passes would come towards it."""
    frames = doubted(look().frames)
    stuck = [replace(one, world_from_sensor=frames[0].world_from_sensor) for one in frames]
    for frame in perceive(stuck):
        assert not (frame.label == MOVING).any()


def test_every_frame_leaves_once_and_soon(busy_street: Any) -> None:
    read = 0

    def reading() -> Iterator[RegisteredFrame]:
        nonlocal read
        for registered in busy_street.frames:
            read += 1
            yield registered

    settings = replace(BALANCED, window=3, stride=1)
    for place, frame in enumerate(LabelFree(settings).perceive(reading())):
        assert frame.registered.index == place
        assert read - place <= settings.window + settings.stride


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_short_drives_are_perceived_whole(busy_street: Any, count: int) -> None:
    frames = perceive(busy_street.frames[:count])
    assert [frame.registered.index for frame in frames] == list(range(count))


def test_an_empty_frame_is_no_trouble(busy_street: Any) -> None:
    frames = list(busy_street.frames[:6])
    frames[3] = replace(frames[3], frame=Frame(np.zeros((0, 3), np.float32), frames[3].frame.stamp))
    assert [len(frame.label) for frame in perceive(frames)] == [len(f.frame) for f in frames]


def test_presets_trade_recall_for_precision(look: Any, new_mover: Any) -> None:
    quick = new_mover(low=(35.0, -3.0, 0.0), size=(0.6, 0.6, 1.7), velocity=(0.0, 4.0, 0.0))
    far = new_mover(low=(38.0, -6.0, 0.0), size=(1.8, 0.6, 1.7), velocity=(-5.0, 0.0, 0.0))
    street = look([quick, far], count=7)
    said = [
        sum(int((frame.label == MOVING).sum()) for frame in perceive(street.frames, preset))
        for preset in (CONSERVATIVE, BALANCED, AGGRESSIVE)
    ]
    assert said[0] < said[1] < said[2]


def test_settings_that_make_no_sense_are_refused() -> None:
    with pytest.raises(SettingsError):
        MotionSettings(window=1)
    with pytest.raises(SettingsError):
        MotionSettings(window=5, stride=5)
