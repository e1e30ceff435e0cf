"""What a training run says on the terminal, and how it is told to end."""

from __future__ import annotations

import math
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

from lidaraccum.errors import MissingDependencyError

if TYPE_CHECKING:
    from pathlib import Path

    from lidaraccum.training.scores import Scores
    from lidaraccum.training.settings import TrainSettings

_RECENT = 100
_STOPPING = b"\nStopping once this step is done; once more stops at once.\n"


class Interrupts:
    """While entered, the first Ctrl-C or SIGTERM is remembered and the second one raised.

    A step cut in two would leave a state that no run ever had.
    """

    def __init__(self) -> None:
        self.came = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interrupts:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._before[number] = signal.signal(number, self._take)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _take(self, number: int, frame: FrameType | None) -> None:
        if self.came:
            raise KeyboardInterrupt
        self.came = True
        os.write(2, _STOPPING)  # a handler may not go through a buffer that is in use


class TrainTalk:
    """A bar on a terminal, a line after each validation, curves in the run's folder.

    Args:
        settings: The run's.
        folder: Where it leaves its files.
        quiet: Say nothing.
        bar: Show a bar where stderr is a terminal.
        on_first: Called once, after the first step: the trainer has taken the run on.
    """

    def __init__(
        self,
        settings: TrainSettings,
        folder: Path,
        *,
        quiet: bool,
        bar: bool,
        on_first: Callable[[], None],
    ) -> None:
        self._settings = settings
        self._folder = folder
        self._quiet = quiet
        self._shows_bar = bar and not quiet and sys.stderr.isatty()
        self._on_first = on_first
        self._bar: Any = None
        self._losses: deque[float] = deque(maxlen=_RECENT)
        self._since = self._latest = (0, time.monotonic())
        self._draws = True
        self._began = False

    def __enter__(self) -> TrainTalk:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: object, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.close()

    def step(self, step: int, loss: float) -> None:
        """One step more."""
        if not self._began:
            self._began = True
            self._since = (step, time.monotonic())  # the first step waits for the first windows
            self._on_first()
            self._open_bar(step - 1)
        self._latest = (step, time.monotonic())
        self._losses.append(loss)
        if self._bar is not None:
            self._bar.update(1)
            self._bar.set_postfix_str(f"loss {self._mean_loss():.3f}", refresh=False)

    def scores(self, step: int, scores: Scores) -> None:
        """A validation is done."""
        self.say(
            f"step {step}: loss {self._mean_loss():.3f}, {self._speed():.2f} windows/s; "
            f"{told_scores(scores)}"
        )
        self.draw()
        self._since = (step, time.monotonic())

    def draw(self) -> None:
        """Redraw the curves; say once where they cannot be drawn."""
        from lidaraccum.training.curves import draw_curves

        if not self._draws:
            return
        try:
            draw_curves(self._folder)
        except MissingDependencyError as error:
            self._draws = False
            self.say(str(error))

    def say(self, text: str) -> None:
        """A line on stderr, above the bar."""
        if not self._quiet:
            from tqdm import tqdm

            tqdm.write(text, file=sys.stderr)

    def _open_bar(self, done: int) -> None:
        if self._shows_bar:
            from tqdm import tqdm

            self._bar = tqdm(
                total=self._settings.steps,
                initial=done,
                unit="window",
                unit_scale=self._settings.optimiser.batch,
                leave=False,
            )

    def _speed(self) -> float:
        """Windows a second since the last validation, itself not counted."""
        (first, start), (last, end) = self._since, self._latest
        windows = (last - first) * self._settings.optimiser.batch
        return windows / (end - start) if windows else math.nan

    def _mean_loss(self) -> float:
        return sum(self._losses) / len(self._losses) if self._losses else math.nan


def told_scores(scores: Scores) -> str:
    """The scores that say most, in a line."""
    return (
        f"static EPE {_cm(scores.static_epe_m)}, dynamic EPE {_cm(scores.dynamic_epe_m)} "
        f"(median {_cm(scores.dynamic_median_m)}), motion IoU {scores.motion_iou:.2f}, "
        f"foreground IoU {scores.foreground_iou:.2f}, WCov {scores.coverage:.2f}"
    )


def _cm(metres: float) -> str:
    return f"{100 * metres:.1f} cm"
