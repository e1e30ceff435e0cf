"""How long the pipeline takes, stage by stage, beside odometry on the same frames."""

from __future__ import annotations

import logging
import resource
import sys
import time
from collections.abc import Sequence as Items
from dataclasses import dataclass, field
from math import nan
from statistics import median

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.data.sequence import Sequence
from lidaraccum.errors import InputError, MissingDependencyError, SettingsError
from lidaraccum.evaluation.benchmark_report import BenchmarkReport, RivalTime, StageTime
from lidaraccum.evaluation.rivals import RIVALS, Rival
from lidaraccum.pipeline.accumulator import AccumulateSettings, Accumulator

log = logging.getLogger(__name__)

DELIVERY = ("read",)
"""Stages that are not the method's own work: frames lie in memory here."""


@dataclass(frozen=True)
class BenchmarkSettings:
    """What is timed.

    Attributes:
        accumulate: What the pipeline is told.
        repeat: Times everything is run; medians are told.
        window: Frames a window.
        rivals: What else is timed.
        processes: Of a streamed run; a window by itself always has one.
    """

    accumulate: AccumulateSettings = field(default_factory=AccumulateSettings)
    repeat: int = 3
    window: int = 5
    rivals: tuple[Rival, ...] = RIVALS
    processes: int = 1

    def __post_init__(self) -> None:
        if self.repeat < 1 or self.window < 2:
            raise SettingsError("a benchmark takes 1 run and a window of 2 frames at least")


class Held:
    """A sequence whose frames lie in memory."""

    def __init__(self, sequence: Sequence, frames: Items[Frame], poses: bool = True) -> None:
        self._frames = frames
        self.name = sequence.name
        self.rate_hz = sequence.rate_hz
        self.crs_wkt = sequence.crs_wkt
        self.poses: NDArray[np.float64] | None = sequence.poses if poses else None

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int, /) -> Frame:
        return self._frames[index]


def benchmark(sequence: Sequence, settings: BenchmarkSettings | None = None) -> BenchmarkReport:
    """Time the pipeline and its rivals on the same frames, turn by turn.

    Frames are held in memory, so that all are timed on their own work. The machine should have
    nothing else to do.

    Raises:
        InputError: Fewer frames than a window.
    """
    settings = settings or BenchmarkSettings()
    if len(sequence) < settings.window:
        raise InputError(f"{sequence.name} has {len(sequence)} frames, not {settings.window}")
    start = time.perf_counter()
    frames = [sequence[index] for index in range(len(sequence))]
    read = time.perf_counter() - start
    timed = _time_all(sequence, frames, settings)
    return BenchmarkReport(
        sequence=sequence.name,
        frames=len(frames),
        points_per_frame=sum(map(len, frames)) / len(frames),
        repeat=settings.repeat,
        window=settings.window,
        read_seconds_per_frame=read / len(frames),
        stages=tuple(
            StageTime(stage, median(run.get(stage, 0.0) for run in timed.streamed) / len(frames))
            for stage in timed.streamed[0]
        ),
        seconds_per_frame=median(timed.totals) / len(frames),
        seconds_per_window=median(timed.window_seconds),
        peak_mb=timed.peak_mb,
        rivals=tuple(timed.rival(rival.name, len(frames)) for rival in settings.rivals),
    )


@dataclass
class _Timed:
    """What all runs took.

    Attributes:
        streamed: Seconds by stage of each run.
        window_seconds: Seconds a window of each run.
        rivals: Seconds of each run by rival.
        skipped: Why a rival was not run.
        peak_mb: After the first run of ours.
    """

    streamed: list[dict[str, float]] = field(default_factory=list)
    window_seconds: list[float] = field(default_factory=list)
    rivals: dict[str, list[float]] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)
    peak_mb: float = nan

    @property
    def totals(self) -> list[float]:
        """Seconds of each streamed run."""
        return [sum(run.values()) for run in self.streamed]

    def rival(self, name: str, frames: int) -> RivalTime:
        """One rival's medians."""
        if name in self.skipped:
            return RivalTime(name, nan, nan, self.skipped[name])
        seconds = self.rivals[name]
        ratios = [ours / its for ours, its in zip(self.totals, seconds, strict=True)]
        return RivalTime(name, median(seconds) / frames, median(ratios))


def _time_all(sequence: Sequence, frames: Items[Frame], settings: BenchmarkSettings) -> _Timed:
    """Everything in turn, as often as the settings say, after a window to warm up."""
    windows = [
        Held(sequence, frames[first : first + settings.window], poses=False)
        for first in range(0, len(frames) - settings.window + 1, settings.window)
    ]
    held, timed = Held(sequence, frames), _Timed()
    _run(windows[0], settings.accumulate)
    for _ in range(settings.repeat):
        timed.streamed.append(_run(held, settings.accumulate, settings.processes))
        spent = sum(sum(_run(one, settings.accumulate).values()) for one in windows)
        timed.window_seconds.append(spent / len(windows))
        if len(timed.streamed) == 1:
            timed.peak_mb = _peak_mb()
        for rival in settings.rivals:
            _time_rival(rival, frames, timed)
    return timed


def _run(sequence: Sequence, settings: AccumulateSettings, processes: int = 1) -> dict[str, float]:
    """Seconds by stage of one run over one sequence."""
    accumulator = Accumulator(sequence, settings, processes=processes)
    for frame in accumulator.frames():
        accumulator.select(frame)
    seconds = accumulator.clock.seconds
    return {stage: spent for stage, spent in seconds.items() if stage not in DELIVERY}


def _time_rival(rival: Rival, frames: Items[Frame], timed: _Timed) -> None:
    if rival.name in timed.skipped:
        return
    try:
        timed.rivals.setdefault(rival.name, []).append(rival.run(frames))
    except MissingDependencyError as error:
        timed.skipped[rival.name] = str(error)
        log.warning("%s is left out: %s", rival.name, error)


def _peak_mb() -> float:
    """Largest resident memory so far, of this process and of the largest it had, 10^6 bytes."""
    unit = 1 if sys.platform == "darwin" else 1024
    sizes = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(resource.getrusage(size).ru_maxrss for size in sizes) * unit / 1e6
