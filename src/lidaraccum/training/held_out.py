"""Windows of labelled sequences that a run does not learn from, as they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.errors import InputError
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.training.truth import window_of
from lidaraccum.training.window import TrainingWindow

EVERY = 5
"""Of so many sequences one is held out."""
_FRAMES = 5


def hold_out(names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Sequences to learn from, and one in five, at least one, to validate on.

    One sequence alone is learned from, and none is held out. The order given does not matter.
    """
    ordered = sorted(set(names))
    held = ordered[EVERY - 1 :: EVERY] or ordered[1:][-1:]
    return tuple(name for name in ordered if name not in held), tuple(held)


@dataclass(frozen=True)
class HeldOutSequences:
    """Windows to watch a run by: five frames, the first the target, one after another.

    Attributes:
        names: What ``open_sequence`` takes, one a sequence.
        open_sequence: Opens one.
        network: Its grid.
        extent_m: Side of the grid, metres.
    """

    names: tuple[str, ...]
    open_sequence: Callable[[str], LabelledSequence]
    network: NetworkSettings
    extent_m: float = 32.0

    def windows(self, drive: int) -> list[TrainingWindow]:
        """One window: sequence after sequence, then each one's next five frames, over and over.

        Raises:
            InputError: The sequence is shorter than two frames.
        """
        sequence = self.open_sequence(self.names[drive % len(self.names)])
        count = len(sequence)
        if count < 2:
            raise InputError(f"{sequence.name} has {count} frame, too few for a window")
        places = max(1, count // _FRAMES)
        first = (drive // len(self.names)) % places * _FRAMES
        chosen = range(first, min(first + _FRAMES, count))
        return [window_of(sequence, chosen, self.network, self.extent_m)]
