"""What `lidaraccum train` learns from: labelled folders, opened where they are read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lidaraccum.errors import InputError

if TYPE_CHECKING:
    from lidaraccum.data.sequence import LabelledSequence
    from lidaraccum.training.dataset import WindowSource
    from lidaraccum.training.settings import TrainSettings


@dataclass(frozen=True)
class Sources:
    """Where windows come from; None leaves it to the trainer: simulated drives."""

    learned: WindowSource | None = None
    held_out: WindowSource | None = None


def open_labelled(folder: str) -> LabelledSequence:
    """A labelled sequence; a plain function, so that worker processes can be told of it.

    Raises:
        InputError: There are no labels.
    """
    from lidaraccum.io.sequences import open_sequence

    sequence = open_sequence(folder)
    if not sequence.has_labels:
        raise InputError(f"{folder} has no labels", hint="a labels folder beside its frames")
    return sequence


def labelled_folders(data: Sequence[str]) -> list[str]:
    """The folders themselves, or the labelled sequences in them, all opened once.

    So what cannot be learned from is said before any work.
    """
    folders = []
    for name in data:
        path = Path(name)
        inside = sorted(child.parent for child in path.glob("*/labels"))
        folders += inside if inside and not (path / "labels").exists() else [path]
    for folder in folders:
        open_labelled(str(folder))
    return [str(folder.resolve()) for folder in folders]


def sources_of(data: Sequence[str], settings: TrainSettings) -> Sources:
    """Windows of labelled sequences, a share of them held out; simulated ones without any."""
    from lidaraccum.training.dataset import RecordedDrives
    from lidaraccum.training.held_out import HeldOutSequences, hold_out
    from lidaraccum.training.trainer import fresh_network

    if not data:
        return Sources()
    network = fresh_network(settings).settings
    learned, held = hold_out(labelled_folders(data))
    recorded = RecordedDrives(learned, open_labelled, network, settings.windows, settings.seed)
    if not held:
        return Sources(recorded)
    return Sources(
        recorded, HeldOutSequences(held, open_labelled, network, settings.windows.extent_m)
    )
