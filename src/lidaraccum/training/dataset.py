"""Training windows: drawn from simulated drives, or from labelled sequences that someone opens."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.errors import InputError, SettingsError
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.raycast import RayCaster
from lidaraccum.simulation.windows import training_settings
from lidaraccum.training.augment import AugmentSettings, LabelledFrame, augment
from lidaraccum.training.truth import make_window
from lidaraccum.training.window import TrainingWindow

FIRST_VALIDATION_SEED = 1_900_000_000
"""Simulated drives from here to the simulator's test set never train."""

_DRIVES_OF_A_SEED = 10_000_000
_VALIDATION_FRAMES = 5


@dataclass(frozen=True)
class WindowSettings:
    """How windows are cut out of drives.

    Attributes:
        extent_m: Side of the grid, metres.
        lengths: Frames a window may have, each as likely as the others: name one twice to have it
            twice as often.
        largest_step: Every 1st to this-th frame of the drive makes the window.
        windows_per_drive: Windows cut out of one drive, overlapping, each augmented its own way.
        drive_frames: Frames of a simulated drive.
        augment: How windows are changed.
    """

    extent_m: float = 32.0
    lengths: tuple[int, ...] = (2, 3, 4, 5, 5, 5, 5, 6, 8)
    largest_step: int = 2
    windows_per_drive: int = 4
    drive_frames: int = 10
    augment: AugmentSettings = field(default_factory=AugmentSettings)

    def __post_init__(self) -> None:
        object.__setattr__(self, "lengths", tuple(self.lengths))
        if not self.lengths or min(self.lengths) < 2:
            raise SettingsError("a window has at least 2 frames")
        if max(self.lengths) > self.drive_frames:
            raise SettingsError("a drive has at least as many frames as its longest window")
        if self.windows_per_drive < 1 or self.largest_step < 1:
            raise SettingsError("windows_per_drive and largest_step are at least 1")


class WindowSource(Protocol):
    """Drives by number, each giving its windows; the same number, the same windows. Picklable."""

    def windows(self, drive: int, /) -> list[TrainingWindow]:
        """As many windows as the settings say, all on one grid."""


@dataclass(frozen=True)
class SimulatedDrives:
    """Windows of drives through made-up streets, with the training seeds.

    Attributes:
        network: Its grid.
        settings: How windows are cut.
        seed: Moves the whole series of drives: another seed, other drives.
        caster: Casts the rays; the simulator's own when None.
    """

    network: NetworkSettings
    settings: WindowSettings = field(default_factory=WindowSettings)
    seed: int = 0
    caster: RayCaster | None = None

    def windows(self, drive: int) -> list[TrainingWindow]:
        """Windows of one drive; points are compensated, as registration hands them on."""
        number = self.seed * _DRIVES_OF_A_SEED + drive
        if not 0 <= drive < _DRIVES_OF_A_SEED or number >= FIRST_VALIDATION_SEED:
            raise SettingsError(f"there is no drive {drive} of seed {self.seed}")
        drawn = replace(training_settings(number, self.settings.drive_frames), compensated=True)
        sequence = simulate(drawn, self.caster)
        rng = np.random.default_rng([self.seed, drive, 1])
        return cut_windows(sequence, self.network, self.settings, rng)


@dataclass(frozen=True)
class ValidationDrives:
    """Windows to watch a run by, as they are: one a drive, five frames, the first the target.

    Their seeds lie between those of training and the simulator's test set.
    """

    network: NetworkSettings
    extent_m: float = 32.0
    caster: RayCaster | None = None

    def windows(self, drive: int) -> list[TrainingWindow]:
        """The one window of a drive, from 0 on."""
        drawn = training_settings(FIRST_VALIDATION_SEED + drive, _VALIDATION_FRAMES)
        sequence = simulate(replace(drawn, compensated=True), self.caster)
        frames = [(sequence[index], sequence.labels(index)) for index in range(len(sequence))]
        return [make_window(frames, 0, self.network, self.extent_m)]


@dataclass(frozen=True)
class RecordedDrives:
    """Windows of labelled sequences, in an order drawn by the seed.

    Attributes:
        names: What ``open_sequence`` takes, one a sequence.
        open_sequence: Opens one; must be picklable for worker processes, so a plain function.
        network: Its grid.
        settings: How windows are cut.
        seed: Of the order and of what is drawn.
    """

    names: tuple[str, ...]
    open_sequence: Callable[[str], LabelledSequence]
    network: NetworkSettings
    settings: WindowSettings = field(default_factory=WindowSettings)
    seed: int = 0

    def windows(self, drive: int) -> list[TrainingWindow]:
        """Windows of one of the sequences, each from its own place in it."""
        rng = np.random.default_rng([self.seed, drive, 2])
        sequence = self.open_sequence(self.names[int(rng.integers(len(self.names)))])
        return cut_windows(sequence, self.network, self.settings, rng)


def cut_windows(
    sequence: LabelledSequence,
    network: NetworkSettings,
    settings: WindowSettings,
    rng: np.random.Generator,
) -> list[TrainingWindow]:
    """Windows from random places of a sequence, augmented.

    Raises:
        InputError: The sequence is shorter than two frames.
    """
    if len(sequence) < 2:
        raise InputError(f"{sequence.name} has {len(sequence)} frame, too few for a window")
    places = [_draw_place(len(sequence), settings, rng) for _ in range(settings.windows_per_drive)]
    read: dict[int, LabelledFrame] = {}
    for index in sorted({index for place in places for index in place}):
        read[index] = (sequence[index], sequence.labels(index))
    windows = []
    for place in places:
        frames = augment([read[index] for index in place], settings.augment, rng)
        target = _draw_target(len(frames), rng)
        windows.append(make_window(frames, target, network, settings.extent_m))
    return windows


def _draw_place(frames: int, settings: WindowSettings, rng: np.random.Generator) -> Sequence[int]:
    """Indices of one window: so many frames, so far apart, as the sequence allows."""
    length = min(int(rng.choice(settings.lengths)), frames)
    longest = max(1, (frames - 1) // (length - 1))
    step = int(rng.integers(1, min(settings.largest_step, longest) + 1))
    first = int(rng.integers(0, frames - (length - 1) * step))
    return range(first, first + length * step, step)


def _draw_target(length: int, rng: np.random.Generator) -> int:
    """Most often the first frame, as in the paper; sometimes the last, or any."""
    return int((0, 0, length - 1, rng.integers(length))[int(rng.integers(4))])
