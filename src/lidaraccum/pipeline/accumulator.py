"""Read me first: the method, a line a step."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lidaraccum.data.accumulation import AccumulatedFrame, Accumulation, ObjectTrack
from lidaraccum.data.frame import Frame
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.data.sequence import LabelledSequence, Sequence
from lidaraccum.errors import InputError, SettingsError
from lidaraccum.geometry import rigid
from lidaraccum.model.weights import available_weights, chosen_weights
from lidaraccum.pipeline.ahead import ahead
from lidaraccum.pipeline.clock import StageClock
from lidaraccum.pipeline.label_free import LabelFree
from lidaraccum.pipeline.motion_settings import PRESETS
from lidaraccum.pipeline.mover_deskew import undo_own_motion
from lidaraccum.pipeline.network_led import NetworkLed
from lidaraccum.pipeline.perception import AllStatic, GivenLabels, Perceiver
from lidaraccum.pipeline.placing import Reference
from lidaraccum.pipeline.report import FrameTally
from lidaraccum.pipeline.selection import Selection, SelectionSettings
from lidaraccum.pipeline.sighting import Sighter
from lidaraccum.pipeline.spool import after_the_last
from lidaraccum.pipeline.tracks import TrackBook
from lidaraccum.pipeline.tubes import Reader
from lidaraccum.registration.apart import Plain, Registrar
from lidaraccum.registration.odometry import register
from lidaraccum.registration.settings import RegistrationSettings

log = logging.getLogger(__name__)

METHODS = ("network", "label-free", "ego-only", "oracle")
"""What finds the movers: the network verified by geometry, geometry alone, nothing, or the labels
that came with the sequence."""


SIGHTING = (LabelFree, NetworkLed)
"""Perceivers that look for free space."""


def default_method(weights: Path | None = None) -> str:
    """``network`` where there are weights, named or shipped, otherwise ``label-free``."""
    return "network" if available_weights(weights) else "label-free"


@dataclass(frozen=True)
class AccumulateSettings:
    """Everything that decides what the cloud looks like.

    Attributes:
        method: One of `METHODS`; `default_method` where none is named.
        weights: The network's, a file; those that came with the package when None.
        preset: How readily something is called moving, a name in `motion_settings.PRESETS`.
        reference: Whose coordinates the cloud is in: ``first``, ``middle``, ``last``, a frame's
            index (negative from the end), or ``world`` for the coordinates of given poses.
        registration: How frames find their place.
        selection: Which points are kept.
    """

    method: str = ""
    weights: Path | None = None
    preset: str = "balanced"
    reference: str = "first"
    registration: RegistrationSettings = field(default_factory=RegistrationSettings)
    selection: SelectionSettings = field(default_factory=SelectionSettings)

    def __post_init__(self) -> None:
        if not self.method:
            object.__setattr__(self, "method", default_method(self.weights))
        if self.weights and self.method != "network":
            raise SettingsError(f"method {self.method!r} takes no weights", hint="network does")
        if self.method not in METHODS:
            raise SettingsError(
                f"there is no method {self.method!r}", hint=f"one of {', '.join(METHODS)}"
            )
        if self.preset not in PRESETS:
            raise SettingsError(
                f"there is no preset {self.preset!r}", hint=f"one of {', '.join(PRESETS)}"
            )


def accumulate(sequence: Sequence, settings: AccumulateSettings | None = None) -> Accumulation:
    """Put all frames of a sequence into one cloud, in memory.

    Args:
        sequence: At least two frames; `lidaraccum.open_sequence` makes one of files.
        settings: The defaults need no poses, no labels and no tuning.

    Raises:
        InputError: The sequence cannot be accumulated; the message says why.
        SettingsError: The settings do not fit the sequence.
    """
    accumulator = Accumulator(sequence, settings or AccumulateSettings())
    frames = [accumulator.select(frame) for frame in accumulator.frames()]
    return Accumulation.from_frames(frames, accumulator.objects())


class Accumulator:
    """One run over one sequence, frame by frame in bounded memory."""

    def __init__(
        self,
        sequence: Sequence,
        settings: AccumulateSettings,
        *,
        perceiver: Perceiver | None = None,
        registered: Iterable[RegisteredFrame] | None = None,
        processes: int = 1,
    ) -> None:
        """Prepare a run.

        Args:
            sequence: What to accumulate.
            settings: How.
            perceiver: What finds the movers, where it is not the one that the settings name.
            registered: The sequence's frames, registered before; otherwise they are read and
                registered here.
            processes: With 2, frames are registered, and what free space takes is made ready, in a
                process of its own while movers are looked for in those before them; the program's
                own module must then be one that can be imported twice (`multiprocessing`'s way to
                start a process).
        """
        if len(sequence) < 2:
            raise InputError(f"{sequence.name} has {len(sequence)} frame; it takes at least 2")
        self._sequence = sequence
        self._settings = settings
        self._reference_index = reference_index(settings.reference, sequence)
        self._perceiver = perceiver or choose_perceiver(settings, sequence)
        self._registrar: Registrar[Any] | None = None
        if processes > 1 and registered is None:
            make: Callable[[RegisteredFrame], Any] = Plain
            if isinstance(self._perceiver, SIGHTING):
                make = Sighter(self._perceiver.settings)
            self._registrar = Registrar(make, settings.registration, sequence.poses)
        self.weights = self._perceiver.weights if isinstance(self._perceiver, NetworkLed) else None
        self._registered = registered
        self._selection = Selection(settings.selection)
        self._book = TrackBook()
        self._reference: Reference | None = None
        self._start = 0.0
        self.clock = StageClock()
        self.tally = FrameTally()

    def frames(self) -> Iterator[AccumulatedFrame]:
        """Each frame in the reference frame, in order, all its points; `select` thins them."""
        try:
            yield from self._frames()
        finally:
            if self._registrar is not None:
                self._registrar.close()

    def _frames(self) -> Iterator[AccumulatedFrame]:
        perceived = self.clock.timed("perceive", self._perceive())
        noted = self._note(self.clock.timed("undo own motion", self._undo(perceived)))
        if self._reference_index > 0:
            noted = self.clock.timed("wait for the reference", after_the_last(noted))
        yield from self.clock.timed("place", self._place(noted))

    def select(self, frame: AccumulatedFrame) -> AccumulatedFrame:
        """The points of a placed frame that go into the cloud; to be called once, in order."""
        with self.clock.stage("select"):
            wanted = self._selection(frame)
        self.tally.count_output(wanted)
        return wanted

    def objects(self) -> list[ObjectTrack]:
        """What was found to be an object, once all frames are through."""
        return self._book.tracks(self._found_reference().reference_from_world)

    def _perceive(self) -> Iterator[PerceivedFrame]:
        if self._registrar is None:
            registered = self._registered
            if registered is None:
                registered = self.clock.timed("register", self._register())
            return self._perceiver.perceive(registered)
        # Reading is no stage that anybody waits for.
        made = ahead(self._registrar.register(ahead(self._read())))
        ready = self.clock.timed("register", made)
        if isinstance(self._perceiver, SIGHTING):
            return self._perceiver.perceive_sighted(ready)
        return self._perceiver.perceive(one.registered for one in ready)

    def _register(self) -> Iterator[RegisteredFrame]:
        frames = self.clock.timed("read", ahead(self._read()))
        return register(frames, self._settings.registration, self._sequence.poses)

    def _read(self) -> Iterator[Frame]:
        for index in range(len(self._sequence)):
            frame = self._sequence[index]
            self.tally.count_frame(frame)
            yield frame

    def _undo(self, frames: Iterable[PerceivedFrame]) -> Iterator[PerceivedFrame]:
        return undo_own_motion(frames, PRESETS[self._settings.preset].max_speed_mps)

    def _note(self, frames: Iterable[PerceivedFrame]) -> Iterator[PerceivedFrame]:
        for perceived in frames:
            registered = perceived.registered
            self._book.note(perceived)
            self.tally.count_registration(registered)
            if registered.index == 0:
                self._start = registered.frame.stamp
            if registered.index == self._reference_index:
                self._reference = self._reference_at(registered)
            yield perceived

    def _reference_at(self, registered: RegisteredFrame) -> Reference:
        in_world = self._settings.reference == "world"
        return Reference(
            index=registered.index,
            reference_from_world=(
                np.eye(4) if in_world else rigid.invert(registered.world_from_sensor)
            ),
            origin=registered.frame.origin,
            start=self._start,
        )

    def _found_reference(self) -> Reference:
        assert self._reference is not None, "the reference frame has not been reached"
        return self._reference

    def _place(self, frames: Iterable[PerceivedFrame]) -> Iterator[AccumulatedFrame]:
        for perceived in frames:
            yield self._found_reference().place(perceived, self._book)


def reference_index(reference: str, sequence: Sequence) -> int:
    """The index of the frame that ``reference`` names.

    Raises:
        SettingsError: No such frame, or ``world`` without given poses.
    """
    count = len(sequence)
    if reference == "world":
        if sequence.poses is None:
            raise SettingsError("reference 'world' needs given poses", hint="--poses FILE")
        return 0
    named = {"first": 0, "middle": count // 2, "last": count - 1}
    if reference in named:
        return named[reference]
    try:
        index = int(reference)
    except ValueError:
        raise SettingsError(
            f"there is no reference {reference!r}", hint="first, middle, last, world or an index"
        ) from None
    if not -count <= index < count:
        raise SettingsError(f"reference frame {index} is outside the sequence's {count} frames")
    return index % count


def choose_perceiver(settings: AccumulateSettings, sequence: Sequence) -> Perceiver:
    """What finds the movers of this sequence.

    Raises:
        InputError: The method needs labels or weights and there are none, or they cannot be read.
    """
    if settings.method == "network":
        return NetworkLed(open_reader(settings.weights), PRESETS[settings.preset])
    if settings.method == "label-free":
        return LabelFree(PRESETS[settings.preset])
    if settings.method == "ego-only":
        return AllStatic()
    if not isinstance(sequence, LabelledSequence):
        raise InputError(
            f"{sequence.name} has no labels",
            hint="method oracle reads labels/ beside frames/",
        )
    return GivenLabels(sequence)


def open_reader(weights: Path | None = None) -> Reader:
    """The network that a file holds, or the shipped one.

    Raises:
        InputError: There is no such file, or none was shipped, or it holds no such network.
    """
    from lidaraccum.model.reader import NetworkReader  # torch takes a second to load

    return NetworkReader.open(chosen_weights(weights))
