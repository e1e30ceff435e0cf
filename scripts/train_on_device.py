"""One stretch of a training run. Usage: train_on_device.py FOLDER MINUTES [SETTINGS].

SETTINGS is a TOML file with a [train] table, such as the train.toml of `lidaraccum train`. What it
leaves open is set for an accelerator beside many cores; BATCH and WINDOWS (cut out of each drive)
in the environment win over it. SIGTERM ends the stretch after its step, with the state saved.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lidaraccum.cli.tables import settings_from
from lidaraccum.model.checkpoint import read_tensors
from lidaraccum.training.settings import TrainSettings
from lidaraccum.training.state import STATE_FILE
from lidaraccum.training.trainer import train
from lidaraccum.training.watch import Watch

BATCH = 8
WINDOWS = 12
"""Cut out of a drive. Making the drive costs as much as cutting ten windows out of it."""
SPEAK_EVERY_S = 20.0


def main() -> None:
    """Resume if there is a state, train for so many minutes more, leave the state."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    folder, minutes = Path(sys.argv[1]), float(sys.argv[2])
    given = table_in(Path(sys.argv[3])) if sys.argv[3:] and sys.argv[3] else {}
    steps, seconds = done_in(folder)
    settings = settings_from(
        TrainSettings, for_device(given, seconds / 3600 + minutes / 60), "train"
    )
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    talk = Talk(settings.optimiser.batch, steps)
    report = train(settings, folder, resume=True, watch=Watch(talk.step, wants_end=stop.is_set))
    print(f"{report.steps} steps in {report.seconds / 60:.1f} min: {report.weights.name}")


def table_in(path: Path) -> dict[str, Any]:
    """The [train] table of a TOML file, without the data it names: drives are simulated here."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib
    table = dict(tomllib.loads(path.read_text()).get("train", {}))
    table.pop("data", None)
    return table


def done_in(folder: Path) -> tuple[int, float]:
    """Steps and seconds that the run in a folder has behind it."""
    if not (folder / STATE_FILE).exists():
        return 0, 0.0
    _, notes = read_tensors(folder / STATE_FILE)
    return int(notes["step"]), float(notes["seconds"])


def for_device(given: Mapping[str, Any], hours: float) -> dict[str, Any]:
    """The [train] table of the stretch: what is given over what suits the machine."""
    usual = {
        "workers": max(1, (os.cpu_count() or 2) - 2),
        "threads": 2,
        "validate_steps": 0,  # scores need no accelerator: see score_weights.py
        "keep_drives": 0,
    }
    windows = {"windows_per_drive": WINDOWS, **given.get("windows", {})}
    optimiser = {"batch": BATCH, **given.get("optimiser", {})}
    if "WINDOWS" in os.environ:
        windows["windows_per_drive"] = int(os.environ["WINDOWS"])
    if "BATCH" in os.environ:
        optimiser["batch"] = int(os.environ["BATCH"])
    mine = {"windows": windows, "optimiser": optimiser, "hours": hours, "processes": 1}
    return {**usual, **given, **mine}


class Talk:
    """Says now and then how far the run is, and how fast.

    Args:
        batch: Windows a step.
        steps: Steps done before this stretch.
    """

    def __init__(self, batch: int, steps: int) -> None:
        self._batch = batch
        self._said, self._steps_said = time.monotonic(), steps

    def step(self, step: int, loss: float) -> None:
        """After each step."""
        passed = time.monotonic() - self._said
        if passed >= SPEAK_EVERY_S:
            rate = self._batch * (step - self._steps_said) / passed
            logging.info("step %d, loss %.3f, %.2f windows a second", step, loss, rate)
            self._said, self._steps_said = time.monotonic(), step


if __name__ == "__main__":
    main()
