"""Training windows: drawn from simulated drives, or from labelled sequences that someone opens."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.errors import SettingsError
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.raycast import RayCaster
from lidaraccum.simulation.windows import training_settings
from lidaraccum.training.cutting import WindowSettings, cut_windows
from lidaraccum.training.truth import window_of
from lidaraccum.training.window import TrainingWindow

__all__ = [
    "RecordedDrives",
    "SimulatedDrives",
    "ValidationDrives",
    "WindowSettings",
    "WindowSource",
]

FIRST_VALIDATION_SEED = 1_900_000_000
"""Simulated drives from here to the simulator's test set never train."""

_DRIVES_OF_A_SEED = 10_000_000
_VALIDATION_FRAMES = 5


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
        """Windows of one drive."""
        rng = np.random.default_rng([self.seed, drive, 1])
        return cut_windows(self.make(drive), self.network, self.settings, rng)

    def make(self, drive: int) -> LabelledSequence:
        """A drive itself; its points are compensated, as registration hands them on."""
        number = self.seed * _DRIVES_OF_A_SEED + drive
        if not 0 <= drive < _DRIVES_OF_A_SEED or number >= FIRST_VALIDATION_SEED:
            raise SettingsError(f"there is no drive {drive} of seed {self.seed}")
        mine = self.settings
        drawn = replace(
            training_settings(number, mine.drive_frames),
            compensated=True,
            green=mine.green,
            dense=mine.dense,
            beside=mine.beside,
            beam_bias=mine.beam_bias,
            furniture=mine.furniture,
            rolling_shutter=mine.rolling_shutter,
            exact=mine.exact,
        )
        if drive % 2:
            drawn = replace(drawn, rare=mine.rare)
        if mine.sensors:
            rng = np.random.default_rng([self.seed, drive, 5])
            drawn = replace(drawn, sensor=str(rng.choice(mine.sensors)))
        return simulate(drawn, self.caster)


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
        return [window_of(sequence, range(len(sequence)), self.network, self.extent_m)]


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
