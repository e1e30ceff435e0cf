"""Windows in the order the run wants them, made by worker processes ahead of time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from torch.utils.data import DataLoader, Dataset

from lidaraccum.training.dataset import WindowSource
from lidaraccum.training.kept import KeptDrives
from lidaraccum.training.window import TrainingWindow
from lidaraccum.training.workers import begin

_AHEAD = 2


class _Drives(Dataset[list[TrainingWindow]]):
    def __init__(self, source: WindowSource, count: int) -> None:
        self._source = source
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, drive: int) -> list[TrainingWindow]:
        return self._source.windows(drive)


class _Kept(Dataset[int]):
    def __init__(self, drives: KeptDrives) -> None:
        self._drives = drives

    def __getitem__(self, number: int) -> int:
        self._drives.stored(number)
        return number


def _as_it_is(made: Any) -> Any:
    return made


def _begin(_worker: int) -> None:
    begin()


def batches_from(
    source: WindowSource, step: int, batch: int, windows_per_drive: int, workers: int
) -> Iterator[list[TrainingWindow]]:
    """Windows of step ``step``, ``step`` + 1, and so on without end.

    A step takes one window from each of ``batch`` drives; when a drive's windows are used up the
    next drives follow. So what a step sees depends on its number alone, wherever the run resumed.
    """
    group = step // windows_per_drive
    skip = step % windows_per_drive
    drives = _drive_stream(source, group * batch, workers)
    while True:
        together = [next(drives) for _ in range(batch)]
        for place in range(skip, windows_per_drive):
            yield [windows[place] for windows in together]
        skip = 0


def _drive_stream(source: WindowSource, first: int, workers: int) -> Iterator[list[TrainingWindow]]:
    most = 2**31 - 1
    yield from _loader(_Drives(source, most), range(first, most), workers)


def store_all(drives: KeptDrives, workers: int) -> Iterator[int]:
    """Make the drives that are not stored yet; each one's number when it is."""
    missing = drives.missing()
    yield from _loader(_Kept(drives), missing, min(workers, len(missing)))


def _loader(dataset: Dataset[Any], order: Sequence[int], workers: int) -> DataLoader[Any]:
    return DataLoader(
        dataset,
        batch_size=None,
        sampler=order,
        num_workers=workers,
        collate_fn=_as_it_is,
        prefetch_factor=_AHEAD if workers else None,
        multiprocessing_context="spawn" if workers else None,
        worker_init_fn=_begin,
    )
