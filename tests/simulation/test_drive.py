"""Laws of simulated drives: the truth fits the points, and the seed decides everything."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.geometry.rigid import invert, transform
from lidaraccum.simulation.drive import DriveSettings, SimulatedSequence, simulate
from lidaraccum.simulation.surfaces import Surface

Distance = Callable[..., NDArray[np.float64]]
EXACT_M = 0.004
"""Rays and meshes are float32, a few hundred metres from their origin."""
BUSY = DriveSettings(
    seed=4, frames=3, sensor="VLP-16", rate_hz=10.0, scene="crossing", speed_mps=9.0,
    rolling_shutter=True, compensated=False, coordinates="sensor", zeros=False, exact=True,
)  # fmt: skip


@cache
def drive(**changes: object) -> SimulatedSequence:
    return simulate(replace(BUSY, **changes))  # type: ignore[arg-type]


def in_world(sequence: SimulatedSequence, index: int) -> NDArray[np.float64]:
    """Points by the truth: each by the pose at its own time, or all by the pose at the stamp."""
    frame, labels = sequence[index], sequence.labels(index)
    if sequence.drawn.compensated or not sequence.drawn.rolling_shutter:
        return transform(labels.world_from_sensor, frame.points)
    poses = sequence.world_from_sensor(frame.stamp + frame.time_offset)
    return np.einsum("nij,nj->ni", poses[:, :3, :3], frame.points) + poses[:, :3, 3]


def digest(sequence: SimulatedSequence, index: int) -> str:
    frame, labels = sequence[index], sequence.labels(index)
    columns = (frame.points, frame.intensity, frame.time_offset, frame.ring, labels.instance,
               labels.dynamic, labels.annotated, labels.world_from_sensor)  # fmt: skip
    boxes = [box.sensor_from_object for box in labels.boxes]
    return hashlib.sha256(b"".join(column.tobytes() for column in (*columns, *boxes))).hexdigest()


def test_is_a_labelled_sequence() -> None:
    sequence = drive()
    assert isinstance(sequence, LabelledSequence)
    assert len(sequence) == 3
    assert sequence.rate_hz == 10.0
    with pytest.raises(IndexError):
        sequence[3]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"compensated": True},
        {"rolling_shutter": False},
        {"rolling_shutter": False, "coordinates": "vehicle"},
    ],
    ids=str,
)
def test_static_points_lie_on_the_worlds_surfaces(
    changes: dict[str, object], distance_to: Distance
) -> None:
    sequence = drive(**changes)
    for index in range(len(sequence)):
        labels = sequence.labels(index)
        still = labels.annotated & (labels.instance == 0)
        assert still.sum() > 3000
        off = distance_to(sequence.world.mesh, in_world(sequence, index)[still])
        assert np.quantile(off, 0.999) < EXACT_M
        assert off.max() < 10 * EXACT_M


def test_noise_is_as_large_as_the_sensor_says(distance_to: Distance) -> None:
    sequence = drive(exact=False, weather="clear", seed=6)
    labels, frame = sequence.labels(1), sequence[1]
    road = labels.annotated & np.isin(labels.semantic, [Surface.BUILDING, Surface.WALL])
    near = road & (np.linalg.norm(frame.points, axis=1) < 30)
    off = distance_to(sequence.world.mesh, in_world(sequence, 1)[near])
    assert 0.001 < np.median(off) < 0.04


def test_beams_are_off_each_by_its_own_and_by_as_much_as_asked() -> None:
    one, more = (
        drive(exact=False, weather="clear", seed=6, zeros=True, beam_bias=factor)
        for factor in (1.0, 5.0)
    )
    first, second = one[1], more[1]
    told = one.labels(1).annotated & more.labels(1).annotated
    off = np.linalg.norm(second.points, axis=1) - np.linalg.norm(first.points, axis=1)
    own = [off[told & (first.ring == beam)] for beam in range(16)]
    assert max(np.ptp(beam) for beam in own if len(beam)) < 1e-4
    usual = one.drawn.sensor.beam_bias_m
    assert 0.3 * usual < np.std([beam.mean() for beam in own if len(beam)]) < 5.0 * usual


@pytest.mark.parametrize("rolling", [True, False])
def test_an_objects_points_lie_on_its_surface_by_its_true_motion(
    rolling: bool, distance_to: Distance
) -> None:
    sequence = drive(rolling_shutter=rolling)
    checked = 0
    for index in range(len(sequence)):
        frame, labels, world = sequence[index], sequence.labels(index), in_world(sequence, index)
        for actor in sequence.actors:
            own = labels.instance == actor.id
            if not own.any():
                continue
            poses = actor.trajectory.poses_at(frame.stamp + frame.time_offset[own])
            back = invert(poses)
            local = np.einsum("nij,nj->ni", back[:, :3, :3], world[own]) + back[:, :3, 3]
            off = np.min([distance_to(mesh, local) for mesh in actor.model.phases], axis=0)
            assert np.quantile(off, 0.99) < EXACT_M
            checked += 1
    assert checked > 5


def test_labels_agree_with_boxes() -> None:
    sequence = drive(rolling_shutter=False)
    for index in range(len(sequence)):
        frame, labels = sequence[index], sequence.labels(index)
        boxes = {box.id: box for box in labels.boxes}
        assert set(np.unique(labels.instance)) - {0} <= set(boxes)
        assert np.array_equal(labels.foreground, labels.instance > 0)
        assert labels.dynamic.any()
        for number, box in boxes.items():
            own = labels.instance == number
            assert (labels.dynamic[own] == box.dynamic).all()
            assert box.dynamic == (box.speed_mps > 0.5)
            inside = np.abs(transform(invert(box.sensor_from_object), frame.points[own]))
            assert (inside <= 0.5 * np.array(box.size_lwh) + 0.02).all()


def test_an_objects_pose_is_its_box_through_the_drive() -> None:
    sequence = drive()
    first, last = sequence.labels(0).world_from_object, sequence.labels(2).world_from_object
    for still in sequence.world.stills:
        if still.id in first and still.id in last:
            assert np.allclose(first[still.id], last[still.id], atol=1e-9)
    for actor in sequence.actors:
        if actor.id in first and actor.id in last:
            gone = np.linalg.norm(last[actor.id][:3, 3] - first[actor.id][:3, 3])
            assert gone == pytest.approx(0.2 * actor.trajectory.speed_at(0.1), abs=0.2)


def test_the_same_seed_gives_the_same_bytes_in_any_order() -> None:
    forth = simulate(BUSY)
    back = simulate(BUSY)
    ahead = [digest(forth, index) for index in (0, 1, 2)]
    behind = [digest(back, index) for index in (2, 1, 0)]
    assert ahead == behind[::-1]
    assert digest(simulate(DriveSettings(seed=5, frames=1, sensor="VLP-16")), 0) not in ahead


def test_another_process_makes_the_same_bytes() -> None:
    code = (
        "from tests.simulation.test_drive import BUSY, digest, simulate\n"
        "print(digest(simulate(BUSY), 1))"
    )
    root = Path(__file__).parents[2]
    answer = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == digest(drive(), 1)


def test_time_offsets_run_from_minus_half_to_half_a_turn() -> None:
    offsets = drive()[1].time_offset
    assert offsets.min() == pytest.approx(-0.05, abs=0.001)
    assert offsets.max() == pytest.approx(0.05, abs=0.001)
    assert (np.diff(offsets) >= 0).all()
    assert not drive(rolling_shutter=False)[1].time_offset.any()


def test_zeros_stand_for_pulses_that_never_came_back() -> None:
    sequence = drive(zeros=True)
    frame, labels, without = sequence[1], sequence.labels(1), drive()[1]
    assert len(frame) == 16 * sequence.drawn.sensor.columns_at(10.0)
    assert np.array_equal(frame.points[frame.returned], without.points)
    assert not labels.annotated[~frame.returned].any()
    assert not labels.foreground[~frame.returned].any()


def test_fog_brings_clutter_that_is_not_scored() -> None:
    sequence = drive(exact=False, weather="fog", seed=9)
    labels = sequence.labels(0)
    clutter = labels.semantic == Surface.CLUTTER
    assert clutter.any()
    assert not labels.annotated[clutter].any()
    assert not labels.foreground[clutter].any()


def test_the_ego_drives_as_asked() -> None:
    poses = [
        drive(scene="straight", manoeuvre="cruise").labels(i).world_from_sensor for i in (0, 2)
    ]
    gone = np.linalg.norm(poses[1][:3, 3] - poses[0][:3, 3])
    assert gone == pytest.approx(9.0 * 0.2, rel=0.1)
    still = drive(scene="straight", speed_mps=0.0, manoeuvre="stand")
    assert np.allclose(still.labels(0).world_from_sensor, still.labels(2).world_from_sensor)


def test_shares_of_movable_and_moving_points_are_those_of_streets() -> None:
    movable, moving = [], []
    for seed in range(100, 110):
        settings = DriveSettings(seed=seed, frames=1, sensor="VLP-16", weather="clear")
        labels = simulate(settings).labels(0)
        movable.append(labels.foreground[labels.annotated].mean())
        moving.append(labels.dynamic[labels.annotated].mean())
    assert 0.04 < np.median(movable) < 0.3
    assert 0.1 < np.sum(moving) / np.sum(movable) < 0.6
