"""The points decide: the true motion costs least, and standing still wins ties."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid
from lidaraccum.pipeline.courses import course
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import BALANCED
from lidaraccum.pipeline.search import find_objects
from lidaraccum.pipeline.suspects import Template, make_template
from lidaraccum.pipeline.verdict import judge, refine_velocity

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
    return make_template(frames[4], picked, 80)


def test_the_true_motion_costs_least(frames: list[SightedFrame], car: Template) -> None:
    rivals = CAR_VELOCITY * np.array([[1.0], [0.0], [0.5], [1.5], [-1.0]])
    verdict = judge(car, rivals, frames, BALANCED)
    assert verdict.cost.argmin() == 0
    assert verdict.cost[0] < 0.4
    assert verdict.cost[1] > 0.8
    assert verdict.through[1] > 0.5 > verdict.through[0]


def test_a_rough_motion_is_refined(frames: list[SightedFrame], car: Template) -> None:
    refined = refine_velocity(car, CAR_VELOCITY + np.array([0.8, 0.5, 0.0]), frames, BALANCED)
    assert np.linalg.norm(refined - CAR_VELOCITY) < 0.6
    assert refined[2] == 0


def test_both_movers_are_found_with_their_motions(frames: list[SightedFrame]) -> None:
    found = sorted(find_objects(frames, BALANCED), key=lambda mover: mover.velocity[0])
    assert len(found) == 2
    assert np.allclose(found[0].velocity, CAR_VELOCITY, atol=0.6)
    assert np.allclose(found[1].velocity, (0.0, -1.6, 0.0), atol=0.6)


def test_a_wall_slides_along_itself_but_stands(frames: list[SightedFrame]) -> None:
    wall = np.flatnonzero((frames[2].points[:, 1] > 8.5) & (np.abs(frames[2].points[:, 0]) < 8))
    template = make_template(frames[2], wall, 80)
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
    template = Template(corner[::8], corner[::8, 2], 0.0, centre)
    for frame in turning:
        frame.near_heights = frame.near_points[:, 2]
    rivals = np.stack([np.zeros(3), velocity, velocity])
    cost = judge(template, rivals, turning, BALANCED, np.array([0.0, 0.0, turn])).cost
    assert cost[2] < 0.2 < cost[1] < cost[0]
    refined = refine_velocity(
        template, velocity + np.array([0.5, -0.4, 0.0]), turning, BALANCED, turn
    )
    np.testing.assert_allclose(refined, velocity, atol=0.2)
