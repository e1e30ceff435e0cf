"""Who is told how a run goes, and may end it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lidaraccum.training.scores import Scores


def _say_nothing(_step: int, _what: float | Scores) -> None:
    pass


def _go_on() -> bool:
    return False


@dataclass(frozen=True)
class Watch:
    """Called by the trainer between steps; as it is, it says nothing and lets the run go on.

    Attributes:
        on_step: Told the step and its loss after each.
        on_scores: Told the step and the scores after each validation; they are in the journal.
        wants_end: Asked after each step; True ends the run with its state saved.
    """

    on_step: Callable[[int, float], None] = _say_nothing
    on_scores: Callable[[int, Scores], None] = _say_nothing
    wants_end: Callable[[], bool] = _go_on
