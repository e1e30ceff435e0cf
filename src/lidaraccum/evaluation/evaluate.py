"""Score methods on labelled drives, window by window. Read `evaluate` first."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.data.window import TARGETS, Window, windows
from lidaraccum.errors import InputError, SettingsError
from lidaraccum.evaluation.baselines import Method, method_by_name
from lidaraccum.evaluation.chained import chained_poses
from lidaraccum.evaluation.scores import Scores, score_window
from lidaraccum.evaluation.truth import Scope, WindowTruth, window_truth
from lidaraccum.pipeline.accumulator import AccumulateSettings, Accumulator
from lidaraccum.registration.odometry import register
from lidaraccum.registration.settings import RegistrationSettings

WINDOW_FRAMES = 5
"""The paper's windows on Waymo."""

Watch = Callable[[Iterable[Window]], Iterable[Window]]


@dataclass(frozen=True)
class EvaluationSettings:
    """What is scored, and how.

    Attributes:
        methods: Names in `baselines.METHODS`, or ``network``.
        weights: Of method ``network``, a file; those that came with the package when None.
        length: Frames a window, T.
        stride: Frames from one window's start to the next; 0 for windows side by side.
        target: One of `TARGETS`: whose coordinates all frames are taken to.
        lengths: Also score windows of these lengths, on the same starts.
        given_poses: Give the pipeline the true poses; otherwise it finds its own.
        scope: Which points are scored.
        registration: How frames find their place.
    """

    methods: tuple[str, ...] = ("ego-only",)
    weights: Path | None = None
    length: int = WINDOW_FRAMES
    stride: int = 0
    target: str = "first"
    lengths: tuple[int, ...] = ()
    given_poses: bool = False
    scope: Scope = field(default_factory=Scope)
    registration: RegistrationSettings = field(default_factory=RegistrationSettings)

    def __post_init__(self) -> None:
        if min((self.length, *self.lengths)) < 2:
            raise SettingsError("a window takes at least 2 frames")
        if self.stride < 0:
            raise SettingsError(f"a stride must not be negative, but is {self.stride}")
        if self.target not in TARGETS:
            raise SettingsError(f"there is no target {self.target!r}", hint=f"one of {TARGETS}")
        self.chosen_methods()

    def chosen_methods(self) -> tuple[Method, ...]:
        """The methods that the names and the weights stand for."""
        return tuple(method_by_name(name, self.weights) for name in self.methods)


@dataclass(frozen=True, eq=False)
class SceneScores:
    """The windows of one sequence."""

    name: str
    scores: Scores


@dataclass(frozen=True, eq=False)
class MethodReport:
    """What one method scored.

    Attributes:
        method: What it is and what it is told.
        scenes: Sequence by sequence, windows of the settings' length.
        by_length: All windows of each further length.
    """

    method: Method
    scenes: tuple[SceneScores, ...]
    by_length: dict[int, Scores]

    @property
    def scores(self) -> Scores:
        """All windows of all scenes."""
        return Scores.pool(scene.scores for scene in self.scenes)


@dataclass(frozen=True, eq=False)
class EvaluationReport:
    """What all methods scored, on the same windows."""

    settings: EvaluationSettings
    methods: tuple[MethodReport, ...]


def evaluate(
    sequences: Iterable[LabelledSequence],
    settings: EvaluationSettings | None = None,
    watch: Watch = iter,
) -> EvaluationReport:
    """Run methods over windows of labelled drives and compare with the truth.

    Args:
        sequences: Each is a scene; frames are read once, window by window.
        settings: What is scored, and how.
        watch: Sees each window go by, for a progress bar.

    Raises:
        InputError: No sequence has a window's worth of frames, or one has no labels.
    """
    settings = settings or EvaluationSettings()
    gathered = [_Gathered(method) for method in settings.chosen_methods()]
    for number, sequence in enumerate(sequences):
        for length in sorted({settings.length, *settings.lengths}):
            stride = settings.stride or settings.length
            opened = windows(sequence, length, stride, settings.target)
            for window in watch(opened):
                for one, scores in zip(gathered, score_methods(window, settings), strict=True):
                    one.note(Scene(number, sequence.name), length, scores)
    if not any(settings.length in one.lengths for one in gathered):
        raise InputError(f"no sequence has {settings.length} frames, a window's worth")
    return EvaluationReport(settings, tuple(one.report(settings) for one in gathered))


@dataclass(frozen=True)
class Scene:
    """A sequence by its number and name: two may be called the same."""

    number: int
    name: str


class _Gathered:
    """One method's scores as they come in."""

    def __init__(self, method: Method) -> None:
        self._method = method
        self._parts: dict[tuple[int, Scene], list[Scores]] = {}

    @property
    def lengths(self) -> set[int]:
        return {length for length, _ in self._parts}

    def note(self, scene: Scene, length: int, scores: Scores) -> None:
        self._parts.setdefault((length, scene), []).append(scores)

    def report(self, settings: EvaluationSettings) -> MethodReport:
        scenes = [
            SceneScores(scene.name, Scores.pool(parts))
            for (length, scene), parts in self._parts.items()
            if length == settings.length
        ]
        by_length = {
            wanted: Scores.pool(
                part
                for (length, _), parts in self._parts.items()
                if length == wanted
                for part in parts
            )
            for wanted in sorted(settings.lengths)
        }
        return MethodReport(self._method, tuple(scenes), by_length)


def score_methods(window: Window, settings: EvaluationSettings) -> Iterator[Scores]:
    """The scores of each method on one window; methods with the same poses share them."""
    truth = window_truth(window, settings.scope)
    posed = _register(window, settings, window.true_poses if settings.given_poses else None)
    chained: _Posed | None = None
    for method in settings.chosen_methods():
        if method.chained and not settings.given_poses:
            chained = chained or _chain(window, settings, posed)
            yield _score(window, truth, method, chained)
        else:
            yield _score(window, truth, method, posed)


@dataclass(frozen=True, eq=False)
class _Posed:
    """A window's frames with their poses, and the CPU seconds that finding them took."""

    frames: list[RegisteredFrame]
    seconds: float


def _register(
    window: Window, settings: EvaluationSettings, given: NDArray[np.float64] | None
) -> _Posed:
    frames = list(window)
    start = time.process_time()
    registered = list(register(iter(frames), settings.registration, given))
    return _Posed(registered, time.process_time() - start)


def _chain(window: Window, settings: EvaluationSettings, posed: _Posed) -> _Posed:
    start = time.process_time()
    poses = np.stack([one.world_from_sensor for one in posed.frames])
    chained = chained_poses(list(window), poses, settings.registration)
    frames = _register(window, settings, chained).frames
    return _Posed(frames, posed.seconds + time.process_time() - start)


def _score(window: Window, truth: WindowTruth, method: Method, posed: _Posed) -> Scores:
    settings = AccumulateSettings(reference=str(window.target))
    perceiver = method.perceiver(window, truth)
    start = time.process_time()
    accumulator = Accumulator(window, settings, perceiver=perceiver, registered=posed.frames)
    placed = list(accumulator.frames())
    seconds = posed.seconds + time.process_time() - start
    return score_window(placed, truth, window.target, seconds, window.sensor)
