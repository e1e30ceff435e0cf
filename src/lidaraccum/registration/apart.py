"""Registration, and making frames ready for what follows, in a process of its own."""

from __future__ import annotations

import multiprocessing
import os
import signal
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.errors import ProcessLostError
from lidaraccum.registration.odometry import register
from lidaraccum.registration.settings import RegistrationSettings

WORTH_FRAMES = 10
"""Fewer frames are registered before another process has started."""


def is_worthwhile(frames: int, busy: int) -> bool:
    """Whether a process of its own pays for so many frames where so many threads are busy."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return frames >= WORTH_FRAMES and (cores or 1) > busy


class OfRegistered(Protocol):
    """Something made of a registered frame, which it holds."""

    registered: RegisteredFrame


Made = TypeVar("Made", bound=OfRegistered)


@dataclass
class Plain:
    """A registered frame, of which nothing more is made."""

    registered: RegisteredFrame


class Registrar(Generic[Made]):
    """A process that registers the frames of one sequence and makes something of each.

    It starts at once, so that it is ready when the first frame has been read. It ends with
    `close`, with the program, and also when the program is killed.
    """

    def __init__(
        self,
        make: Callable[[RegisteredFrame], Made],
        settings: RegistrationSettings | None = None,
        given: NDArray[np.float64] | None = None,
    ) -> None:
        """Start the process.

        Args:
            make: What to make of each registered frame there, such as `Plain`; picklable, as is
                what it makes.
            settings: Those of `register`.
            given: Poses, as `register` takes them.
        """
        self._settings = settings or RegistrationSettings()
        context = multiprocessing.get_context("spawn")
        self._pipe, its = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(its, make, self._settings, given), name="registration", daemon=True
        )
        with _interrupts_held_back():
            self._process.start()
        its.close()

    def register(self, frames: Iterable[Frame]) -> Iterator[Made]:
        """As `odometry.register`, once: what is made of the frames, in order, each exactly once.

        Raises:
            ProcessLostError: The process has ended before its work was done.
        """
        waiting: deque[Frame] = deque()
        for count, frame in enumerate(frames, 1):
            waiting.append(frame)
            self._send(_bare(frame))
            if count >= self._settings.lookahead:
                while waiting:
                    yield self._receive(waiting.popleft())
        self._send(None)
        while waiting:
            yield self._receive(waiting.popleft())
        self._answer()

    def close(self) -> None:
        """End the process, whatever it is at."""
        self._process.terminate()
        self._process.join()
        self._pipe.close()

    def _send(self, message: Frame | None) -> None:
        try:
            self._pipe.send(message)
        except (BrokenPipeError, ConnectionResetError):
            self._answer()  # it may have said why before it ended
            raise

    def _receive(self, frame: Frame) -> Made:
        made = self._answer()
        assert made is not None
        if made.registered.deskewed:
            frame = frame.with_points(made.registered.frame.points)
        made.registered = replace(made.registered, frame=frame)
        return made

    def _answer(self) -> Made | None:
        """What comes next: what was made of a frame, or nothing more."""
        try:
            answer: Made | _Failure | None = self._pipe.recv()
        except (EOFError, ConnectionResetError) as error:
            self._process.join()
            raise ProcessLostError(
                f"the process that registers frames has ended (exit code {self._process.exitcode})",
                hint="memory may have run out; --processes 1 works without it",
            ) from error
        if isinstance(answer, _Failure):
            raise answer.error from RuntimeError(answer.trace)
        return answer


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Ctrl-C waits, and for ever in a process that is started meanwhile: it is not its to hear."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # to start it together with another would let Ctrl-C through
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@dataclass(frozen=True)
class _Failure:
    """What went wrong there, and where, as text."""

    error: Exception
    trace: str


def _bare(frame: Frame) -> Frame:
    """What registration asks of a frame."""
    return Frame(
        points=frame.points,
        stamp=frame.stamp,
        time_offset=frame.time_offset,
        ring=frame.ring,
        origin=frame.origin,
        name=frame.name,
    )


def _serve(
    pipe: Connection,
    make: Callable[[RegisteredFrame], Made],
    settings: RegistrationSettings,
    given: NDArray[np.float64] | None,
) -> None:
    """What the process does: register what comes, until nothing more does or nobody listens."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where it could not be held back
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        try:
            for registered in register(iter(pipe.recv, None), settings, given):
                made = make(registered)
                made.registered = _without_known(registered)
                pipe.send(made)
            pipe.send(None)
        except (EOFError, OSError):
            raise
        except Exception as error:
            pipe.send(_Failure(error, traceback.format_exc()))


def _without_known(registered: RegisteredFrame) -> RegisteredFrame:
    """A registered frame without what the caller has: its points too, unless they were moved."""
    points = registered.frame.points if registered.deskewed else np.zeros((0, 3), np.float32)
    return replace(registered, frame=Frame(points, registered.frame.stamp))
