"""One stretch of a training run. Usage: train_on_device.py FOLDER MINUTES [SETTINGS.json]."""

from __future__ import annotations

import json
import logging
import os
import sys
from dataclasses import replace
from pathlib import Path

from lidaraccum.training.settings import OptimiserSettings, TrainSettings
from lidaraccum.training.state import STATE_FILE
from lidaraccum.training.trainer import train

PLAIN = {"seed", "workers", "threads", "validate_steps", "validation_windows", "checkpoint_minutes"}


def hours_done(folder: Path) -> float:
    """Hours the run in a folder has taken so far."""
    from lidaraccum.model.checkpoint import read_tensors

    if not (folder / STATE_FILE).exists():
        return 0.0
    return float(read_tensors(folder / STATE_FILE)[1]["seconds"]) / 3600.0


def main() -> None:
    """Resume if there is a state, train for so many minutes more, leave the state."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    folder, minutes = Path(sys.argv[1]), float(sys.argv[2])
    given = json.loads(Path(sys.argv[3]).read_text()) if len(sys.argv) > 3 and sys.argv[3] else {}
    workers = max(1, (os.cpu_count() or 2) - 1)
    settings = TrainSettings(hours=hours_done(folder) + minutes / 60.0, workers=workers)
    settings = replace(settings, **{name: given[name] for name in PLAIN & set(given)})
    settings = replace(settings, optimiser=OptimiserSettings(**given.get("optimiser", {})))
    report = train(settings, folder, resume=True)
    print(f"{report.steps} steps in {report.seconds / 60:.1f} min: {report.weights}")


if __name__ == "__main__":
    main()
