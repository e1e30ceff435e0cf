"""What finished weights are scored on: the simulator's test set, labelled recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from lidaraccum.data.frame import Labels
from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.errors import InputError, SettingsError
from lidaraccum.io.sequences import open_sequence
from lidaraccum.model.network import Network
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.windows import TEST_WINDOWS, held_out_numbers, held_out_settings
from lidaraccum.training.augment import LabelledFrame, turned
from lidaraccum.training.scores import Scores, score_network
from lidaraccum.training.truth import make_window
from lidaraccum.training.window import Batch, make_batch

WINDOW = 5


@dataclass(frozen=True)
class ExamSettings:
    """What weights are scored on; five frames a window, the first the target.

    Attributes:
        windows: Of the simulator's test set, spread evenly over it.
        extent_m: Side of the grid, metres.
        drives: Folders with a labelled recording each, of different names.
        drive_windows: Windows of each recording, spread evenly over it.
    """

    windows: int = 40
    extent_m: float = 64.0
    drives: tuple[Path, ...] = ()
    drive_windows: int = 20

    def __post_init__(self) -> None:
        if not 0 <= self.windows <= TEST_WINDOWS or self.drive_windows < 1:
            raise SettingsError(
                f"an exam has 0 to {TEST_WINDOWS} simulated windows and 1 or more of a recording"
            )
        if len({drive.name for drive in self.drives}) < len(self.drives):
            raise SettingsError("recordings to score on need names of their own")


@dataclass(frozen=True)
class Marks:
    """What weights scored.

    Attributes:
        simulated: On the simulator's test set.
        recorded: On each recording, by its folder's name.
    """

    simulated: Scores
    recorded: Mapping[str, Scores]


def examine(
    network: Network, settings: ExamSettings, wants_end: Callable[[], bool]
) -> Marks | None:
    """Score a network; None if that was ended before it was done.

    Raises:
        InputError: A recording cannot be read, or is too short.
    """
    size = (settings.extent_m, network.settings)

    def score(batches: Iterator[Batch]) -> Scores:
        return score_network(network, takewhile(lambda _: not wants_end(), batches))

    simulated = score(simulated_windows(settings.windows, *size))
    recorded = {
        drive.name: score(recorded_windows(drive, settings.drive_windows, *size))
        for drive in settings.drives
    }
    return None if wants_end() else Marks(simulated, recorded)


def simulated_windows(
    count: int,
    extent_m: float,
    settings: NetworkSettings,
    *,
    yaw_deg: float = 0.0,
    dense: float = 0.0,
    beside: float = 0.0,
) -> Iterator[Batch]:
    """So many windows of the simulator's test set, on a grid of that side, metres; all turned.

    So many of their hedges, bushes and low crowns are ``dense``, and so many large things stand
    ``beside`` each 20 m of the way; none in the test set itself.
    """
    for number in held_out_numbers(count) if count else ():
        drawn = replace(held_out_settings(number), compensated=True, dense=dense, beside=beside)
        drive = simulate(drawn)
        frames = _turned(drive, range(len(drive)), yaw_deg)
        yield make_batch([make_window(frames, 0, settings, extent_m)])


def recorded_windows(
    folder: Path,
    count: int,
    extent_m: float,
    settings: NetworkSettings,
    *,
    classed: bool = False,
    yaw_deg: float = 0.0,
) -> Iterator[Batch]:
    """Windows spread evenly over a labelled drive, as its files are.

    Args:
        folder: The drive.
        count: Windows at most.
        extent_m: Side of the grid, metres.
        settings: The network's.
        classed: Points whose ``semantic`` class is 0 or less, nothing or unknown, count as not
            annotated, as in SemanticKITTI's own benchmark; else the file's ``annotated`` decides.
        yaw_deg: All frames are turned so far about z, as if the sensor were mounted otherwise.

    Raises:
        InputError: The drive cannot be read, or is shorter than a window.
    """
    drive = open_sequence(folder)
    if len(drive) < WINDOW:
        raise InputError(f"{folder} has {len(drive)} frames, too few for a window of {WINDOW}")
    starts = np.unique(np.linspace(0, len(drive) - WINDOW, count).astype(int)).tolist()
    for start in starts:
        frames = _turned(drive, range(start, start + WINDOW), yaw_deg)
        if classed:
            frames = [(frame, _classed_alone(labels)) for frame, labels in frames]
        yield make_batch([make_window(frames, 0, settings, extent_m)])


def _turned(drive: LabelledSequence, places: range, yaw_deg: float) -> list[LabelledFrame]:
    return [turned(drive[place], drive.labels(place), yaw_deg) for place in places]


def _classed_alone(labels: Labels) -> Labels:
    """Labels of which only points of a named class are annotated."""
    if labels.semantic is None:
        return labels
    named = labels.semantic > 0
    return replace(
        labels, annotated=named if labels.annotated is None else named & labels.annotated
    )
