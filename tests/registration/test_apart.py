"""Another process registers as this one does, says what went wrong there, and ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator
from operator import attrgetter
from typing import Any

import numpy as np
import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.errors import InputError, ProcessLostError
from lidaraccum.registration.apart import Plain, Registrar
from lidaraccum.registration.odometry import register
from lidaraccum.registration.settings import RegistrationSettings


@pytest.fixture
def registrar() -> Iterator[Registrar[Plain]]:
    """A process for the defaults, ended whatever happens."""
    made = Registrar(Plain)
    yield made
    made.close()
    assert not multiprocessing.active_children()


def with_more(frame: Frame) -> Frame:
    """A frame with things that registration does not ask for."""
    numbers = np.arange(len(frame))
    return Frame(
        frame.points, frame.stamp, numbers, frame.time_offset, attributes={"echo": numbers}
    )


@pytest.mark.parametrize(("kind", "count"), [("straight", 12), ("rolling", 6), ("straight", 3)])
def test_frames_come_back_as_if_registered_here(
    request: pytest.FixtureRequest, registrar: Registrar[Plain], kind: str, count: int
) -> None:
    frames = [with_more(frame) for frame in request.getfixturevalue(kind).frames[:count]]
    there = [one.registered for one in registrar.register(iter(frames))]
    here = list(register(iter(frames)))
    assert len(there) == len(here) == count
    for one, other in zip(there, here, strict=True):
        assert one.index == other.index
        assert one.quality == other.quality
        assert one.deskewed is other.deskewed
        np.testing.assert_array_equal(one.world_from_sensor, other.world_from_sensor)
        np.testing.assert_array_equal(one.frame.points, other.frame.points)
        np.testing.assert_array_equal(one.frame.attributes["echo"], np.arange(len(one.frame)))
        np.testing.assert_array_equal(one.seconds_within_sweep, other.seconds_within_sweep)


def test_given_poses_are_used_and_their_number_counts_there_too(straight: Any) -> None:
    given = straight.poses
    settings = RegistrationSettings()
    short = Registrar(Plain, settings, given[:-1])
    whole = Registrar(Plain, settings, given)
    try:
        frames = list(whole.register(straight.frames))
        assert frames[-1].registered.world_from_sensor == pytest.approx(given[-1])
        with pytest.raises((InputError, IndexError)) as caught:
            list(short.register(straight.frames))
        assert "in _serve" in str(caught.value.__cause__)
    finally:
        short.close()
        whole.close()


def test_what_cannot_be_made_there_is_told_here(straight: Any) -> None:
    registrar: Registrar[Plain] = Registrar(attrgetter("no_such_thing"))
    try:
        with pytest.raises(AttributeError, match="no_such_thing"):
            list(registrar.register(straight.frames))
    finally:
        registrar.close()


def test_a_process_that_is_killed_is_told(registrar: Registrar[Plain], straight: Any) -> None:
    frames = registrar.register(straight.frames)
    next(frames)
    (process,) = multiprocessing.active_children()
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    with pytest.raises(ProcessLostError, match="exit code -9"):
        list(frames)
