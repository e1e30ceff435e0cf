"""Trains on car parks until it is killed. Usage: endless.py FOLDER WORKERS."""

from __future__ import annotations

import sys
from pathlib import Path

from toy import SMALL, WINDOWS, CarParks

from lidaraccum.training.settings import TrainSettings
from lidaraccum.training.trainer import train


def main() -> None:
    """Checkpoints after every step."""
    settings = TrainSettings(
        network=SMALL, windows=WINDOWS, hours=1.0, workers=int(sys.argv[2]), threads=1,
        checkpoint_minutes=0.0, validate_steps=0, log_steps=1, device="cpu",
    )  # fmt: skip
    train(settings, Path(sys.argv[1]), source=CarParks(), resume=True)


if __name__ == "__main__":
    main()
