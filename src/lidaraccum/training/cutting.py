"""How windows are cut out of a labelled drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.errors import InputError, SettingsError
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.simulation.settings import DriveSettings
from lidaraccum.training.augment import AugmentSettings, LabelledFrame, augment
from lidaraccum.training.ground_error import misjudge_ground
from lidaraccum.training.truth import make_window
from lidaraccum.training.window import TrainingWindow


@dataclass(frozen=True)
class WindowSettings:
    """How windows are cut out of drives.

    Attributes:
        extent_m: Side of the grid, metres.
        lengths: Frames a window may have, each as likely as the others: name one twice to have it
            twice as often.
        largest_step: Every 1st to this-th frame of the drive makes the window.
        longest_s: Seconds a window spans at most, if it has more than two frames: in a second a
            fast car leaves most of the grid behind, and there is nothing left to compare.
        windows_per_drive: Windows cut out of one drive, overlapping, each augmented its own way.
        drive_frames: Frames of a simulated drive.
        sensors: Sensors of simulated drives by name, each as likely as the others; all there are,
            and made-up ones, when empty.
        rare: In every other simulated drive what is movable but no car nor on foot is so many times
            as likely as usual: a lorry that is met once in a hundred windows is not learned.
        green: Simulated gardens have so many times as much growth as is drawn; none at 0.
        dense: Share of what grows in simulated gardens that is closed outside.
        beside: So many large things stand right beside each 20 m of simulated egos' ways, besides
            what streets have.
        beam_bias: Simulated beams' ranges are off by up to so many times as much as usual.
        furniture: Whether signs, bins, kiosks and the like stand about in simulated drives.
        rolling_shutter: Whether simulated sweeps take their time; drawn when None.
        exact: Simulated points without noise, losses, mixed edges or weather.
        augment: How windows are changed.
    """

    extent_m: float = 32.0
    lengths: tuple[int, ...] = (2, 3, 4, 5, 5, 5, 5, 6, 8)
    largest_step: int = 2
    longest_s: float = 0.8
    windows_per_drive: int = 4
    drive_frames: int = 10
    sensors: tuple[str, ...] = ()
    rare: float = 1.0
    green: float = 1.0
    dense: float = 0.0
    beside: float = 0.0
    beam_bias: float = 1.0
    furniture: bool = True
    rolling_shutter: bool | None = None
    exact: bool = False
    augment: AugmentSettings = field(default_factory=AugmentSettings)

    def __post_init__(self) -> None:
        object.__setattr__(self, "lengths", tuple(self.lengths))
        object.__setattr__(self, "sensors", tuple(self.sensors))
        if not self.lengths or min(self.lengths) < 2:
            raise SettingsError("a window has at least 2 frames")
        if max(self.lengths) > self.drive_frames:
            raise SettingsError("a drive has at least as many frames as its longest window")
        if self.windows_per_drive < 1 or self.largest_step < 1:
            raise SettingsError("windows_per_drive and largest_step are at least 1")
        DriveSettings(  # refuses what it cannot be
            rare=self.rare, green=self.green, dense=self.dense, beside=self.beside,
            beam_bias=self.beam_bias,
        )  # fmt: skip
        for name in self.sensors:
            DriveSettings(sensor=name)  # refuses what no sensor is called


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
    places = [_draw_place(sequence, settings, rng) for _ in range(settings.windows_per_drive)]
    read: dict[int, LabelledFrame] = {}
    for index in sorted({index for place in places for index in place}):
        read[index] = (sequence[index], sequence.labels(index))
    windows = []
    for place in places:
        frames = augment([read[index] for index in place], settings.augment, rng)
        target = _draw_target(len(frames), rng)
        window = make_window(frames, target, network, settings.extent_m)
        windows.append(misjudge_ground(window, settings.augment.ground_m, rng))
    return windows


def _draw_place(
    sequence: LabelledSequence, settings: WindowSettings, rng: np.random.Generator
) -> Sequence[int]:
    """Indices of one window: so many frames, so far apart, as sequence and settings allow."""
    frames = len(sequence)
    length = min(int(rng.choice(settings.lengths)), frames)
    longest = max(1, (frames - 1) // (length - 1))
    step = int(rng.integers(1, min(settings.largest_step, longest) + 1))
    length = min(length, max(2, 1 + int(settings.longest_s * sequence.rate_hz / step + 1e-6)))
    first = int(rng.integers(0, frames - (length - 1) * step))
    return range(first, first + length * step, step)


def _draw_target(length: int, rng: np.random.Generator) -> int:
    """Most often the first frame, as in the paper; sometimes the last, or any."""
    return int((0, 0, length - 1, rng.integers(length))[int(rng.integers(4))])
