"""The points decide: the true motion costs least, and standing still wins ties."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame, RegistrationQuality
from lidaraccum.geometry import rigid
from lidaraccum.pipeline.courses import course
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.landing import Lineup
from lidaraccum.pipeline.motion_settings import BALANCED
from lidaraccum.pipeline.search import find_objects
from lidaraccum.pipeline.suspects import Template, template_of
from lidaraccum.pipeline.verdict import (
    bend_course,
    judge,
    refine_velocities,
    slide_velocity,
)

CAR_VELOCITY = np.array([-8.0, 0.0, 0.0])


def window(street: Any, count: int = 5) -> list[SightedFrame]:
    frames = [SightedFrame(registered, BALANCED) for registered in street.frames[:count]]
    for frame in frames:
        for other in frames:
            if frame is not other:
                frame.watch(other)
    return frames


@pytest.fixture(scope="module")
def frames(busy_street: Any) -> list[SightedFrame]:
    return window(busy_street)


@pytest.fixture
def car(frames: list[SightedFrame], busy_street: Any) -> Template:
    picked = np.flatnonzero(busy_street.on[4][frames[4].rows] == 1)
    return template_of(frames[4], picked, 80)


def test_the_true_motion_costs_least(frames: list[SightedFrame], car: Template) -> None:
    rivals = CAR_VELOCITY * np.array([[1.0], [0.0], [0.5], [1.5], [-1.0]])
    verdict = judge(car, rivals, frames, BALANCED)
    assert verdict.cost.argmin() == 0
    assert verdict.cost[0] < 0.4
    assert verdict.cost[1] > 0.8
    assert verdict.through[1] > 0.5 > verdict.through[0]


def test_what_is_hidden_shows_nothing(frames: list[SightedFrame], car: Template) -> None:
    """Before the sensor's eyes the car shows that it moves; behind a wall it might do anything."""
    rivals = np.stack([np.zeros(3), CAR_VELOCITY])
    seen = judge(car, rivals, frames, BALANCED)
    assert seen.shown[0] == 0
    assert seen.shown[1] > BALANCED.shown
    behind = replace(car, world=car.world + np.array([0.0, 18.0, 0.0]))
    hidden = judge(behind, rivals, frames, BALANCED)
    assert hidden.cost[0] > 0.5
    assert abs(hidden.shown[1]) < 0.05


def test_a_rough_motion_is_refined(frames: list[SightedFrame], car: Template) -> None:
    rough = (CAR_VELOCITY + np.array([0.8, 0.5, 0.0]))[None]
    (refined,) = refine_velocities(car, rough, np.zeros(1), frames, BALANCED)
    assert np.linalg.norm(refined - CAR_VELOCITY) < 0.6
    assert refined[2] == 0


def test_both_movers_are_found_with_their_motions(frames: list[SightedFrame]) -> None:
    found = sorted(find_objects(frames, BALANCED), key=lambda mover: mover.velocity[0])
    assert len(found) == 2
    assert np.allclose(found[0].velocity, CAR_VELOCITY, atol=0.6)
    assert np.allclose(found[1].velocity, (0.0, -1.6, 0.0), atol=0.6)


def test_a_wall_slides_along_itself_but_stands(frames: list[SightedFrame]) -> None:
    wall = np.flatnonzero((frames[2].points[:, 1] > 8.5) & (np.abs(frames[2].points[:, 0]) < 8))
    template = template_of(frames[2], wall, 80)
    along = np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [-3.0, 0.0, 0.0]])
    cost = judge(template, along, frames, BALANCED).cost
    assert (cost[0] < cost[1:] + BALANCED.margin).all()


def test_a_still_street_has_no_movers(look: Any) -> None:
    assert find_objects(window(look(noise=0.03, count=5)), BALANCED) == []


def test_a_parked_car_that_a_mover_touches_stays(look: Any, new_mover: Any) -> None:
    beside = new_mover(low=(6.5, 2.75, 0.2), size=(4.0, 1.8, 1.5), velocity=(-6.0, 0.0, 0.0))
    street = look([beside], count=5, speed=0.0)
    frames = window(street)
    found = find_objects(frames, BALANCED)
    assert len(found) == 1
    for place, frame in enumerate(frames):
        picked = found[0].picked[frame.index]
        on = street.on[place][frame.rows[picked]]
        assert (on == 1).mean() > 0.9


def test_a_turning_car_is_explained_by_its_turn(frames: list[SightedFrame]) -> None:
    """A box that turns half a radian a second beside points that do."""
    rng = np.random.default_rng(1)
    side = np.column_stack([rng.uniform(-2, 2, 400), np.full(400, 0.9), rng.uniform(0.3, 1.4, 400)])
    back = np.column_stack([np.full(200, -2.0), rng.uniform(-0.9, 0.9, 200), side[:200, 2]])
    corner = np.concatenate([side, back]) + np.array([10.0, 0.0, 0.0])
    velocity, turn = np.array([5.0, 1.0, 0.0]), 1.2
    centre = corner.mean(axis=0)
    turning = [
        SightedFrame(
            replace(
                one.registered,
                world_from_sensor=np.eye(4),
                frame=Frame(
                    rigid.transform(course(centre, velocity, turn, one.stamp), corner).astype(
                        np.float32
                    ),
                    one.stamp,
                ),
            ),
            BALANCED,
        )
        for one in frames
    ]
    template = Template(corner[::8], corner[::8, 2], 0.0, np.zeros(len(corner[::8])), centre)
    for frame in turning:
        frame.near_heights = frame.near_points[:, 2]
    rivals = np.stack([np.zeros(3), velocity, velocity])
    cost = judge(template, rivals, turning, BALANCED, np.array([0.0, 0.0, turn])).cost
    assert cost[2] < 0.2 < cost[1] < cost[0]
    rough = (velocity + np.array([0.5, -0.4, 0.0]))[None]
    (refined,) = refine_velocities(template, rough, np.array([turn]), turning, BALANCED)
    np.testing.assert_allclose(refined, velocity, atol=0.2)
    bent, found = bend_course(template, velocity + np.array([0.3, -0.3, 0.0]), turning, BALANCED)
    assert abs(found - turn) < 0.3
    assert judge(template, bent[None], turning, BALANCED, np.array([found])).cost[0] < 0.2


def test_what_goes_straight_is_not_bent(frames: list[SightedFrame], car: Template) -> None:
    velocity, turn = bend_course(car, CAR_VELOCITY, frames, BALANCED)
    assert turn == 0
    np.testing.assert_array_equal(velocity, CAR_VELOCITY)


def test_a_truck_is_not_slid_along_its_own_side(look: Any, new_mover: Any) -> None:
    """Its long side has partners wherever it goes; its ends tell, and make it one thing."""
    velocity = np.array([-22.0, 0.0, 0.0])
    truck = new_mover(low=(7.0, 1.6, 0.1), size=(14.0, 2.4, 3.2), velocity=tuple(velocity))
    street = look([truck], count=5, speed=10.0)
    frames = window(street)
    found = find_objects(frames, BALANCED)
    assert len(found) == 1
    np.testing.assert_allclose(found[0].velocity, velocity, atol=1.0)
    shares = []
    for frame, on in zip(frames, street.on, strict=True):
        mine = np.flatnonzero(on[frame.rows] == 1)
        picked = found[0].picked[frame.index]
        shares.append(len(np.intersect1d(picked, mine)) / len(mine))
        assert len(np.setdiff1d(picked, mine)) < 0.05 * len(mine)
    assert np.mean(shares) > 0.9


def test_a_slide_finds_its_way_back(frames: list[SightedFrame], car: Template) -> None:
    for wrong in (-2.0, 1.5):
        start = CAR_VELOCITY * (1 + wrong / 8.0)
        back = slide_velocity(car, start, frames, BALANCED)
        assert np.linalg.norm(back - CAR_VELOCITY) < 0.4
    assert np.array_equal(slide_velocity(car, np.zeros(3), frames, BALANCED), np.zeros(3))


def test_what_moves_is_met_when_the_sweep_comes_by() -> None:
    """A sweep begins behind and takes 0.1 s; where nothing tells the time, it takes none."""
    rng = np.random.default_rng(0)
    azimuth = rng.uniform(-np.pi, np.pi, 4000)
    place = np.column_stack([12 * np.cos(azimuth), 12 * np.sin(azimuth), rng.uniform(-1, 1, 4000)])
    quality = RegistrationQuality("given", 1.0, 0.0)
    swept = RegisteredFrame(
        1, Frame(place.astype(np.float32), stamp=0.1), np.eye(4), quality,
        seconds_from_stamp=(azimuth * 0.1 / (2 * np.pi)).astype(np.float32),
    )  # fmt: skip
    frame = SightedFrame(swept, BALANCED)
    velocity = np.array([15.0, 0.0, 0.0])
    ahead = np.array([[0.0, 8.0, 0.0]])  # a quarter turn after the stamp: 0.025 s
    template = Template(ahead, np.zeros(1), 0.1, np.array([-0.01]), ahead[0])
    met = Lineup([frame]).land(template, velocity[None], np.zeros(1))[:, 0, 0].T
    np.testing.assert_allclose(met, ahead + velocity * (0.025 + 0.01), atol=0.03)
    untimed = SightedFrame(replace(swept, seconds_from_stamp=None), BALANCED)
    timeless = replace(template, seconds=np.zeros(1))
    met = Lineup([untimed]).land(timeless, velocity[None], np.zeros(1))[:, 0, 0].T
    np.testing.assert_array_equal(met, ahead)
    picked = np.arange(len(frame.rows))
    at_stamp = frame.world_at_stamp(picked, velocity)
    later = (frame.points - at_stamp)[:, 0] / 15.0
    np.testing.assert_allclose(later, azimuth[frame.rows] * 0.1 / (2 * np.pi), atol=1e-4)
