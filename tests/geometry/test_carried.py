"""What goes along with the sensor, and what only passes it."""

from __future__ import annotations

import numpy as np

from lidaraccum.geometry.carried import carried

FRAMES = 5
SHIFT = np.array([4.0, 0.5, 0.0])


def _flank(x: tuple[float, float], y: float) -> np.ndarray:
    along, up = np.meshgrid(np.arange(*x, 0.1), np.arange(-1.5, -0.5, 0.1))
    return np.column_stack([along.ravel(), np.full(along.size, y), up.ravel()])


def _seen(places: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    frame = np.repeat(np.arange(FRAMES), [len(one) for one in places])
    return np.concatenate(places), frame


def test_the_own_roof_goes_along_whatever_way_the_sensor_looks() -> None:
    roof = _flank((-1.0, 2.0), 0.4)
    for yaw in (0.0, 2.0):
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        places, frame = _seen([roof @ turn.T] * FRAMES)
        assert carried(places, frame, FRAMES, turn @ SHIFT).all()


def test_a_lorry_that_keeps_pace_beside_the_sensor_does_not() -> None:
    places, frame = _seen([_flank((-2.0, 2.0), 1.6)] * FRAMES)
    assert not carried(places, frame, FRAMES, SHIFT).any()


def test_what_is_met_on_the_way_does_not() -> None:
    places, frame = _seen([_flank((2.2 - one, 2.4 - one), 0.5) for one in range(FRAMES)])
    assert not carried(places, frame, FRAMES, SHIFT).any()


def test_who_stands_still_has_no_way_to_tell_by() -> None:
    places, frame = _seen([_flank((-1.0, 2.0), 0.4)] * FRAMES)
    assert not carried(places, frame, FRAMES, 0.01 * SHIFT).any()
    assert carried(places[:0], frame[:0], FRAMES, SHIFT).shape == (0,)
