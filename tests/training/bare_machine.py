"""Trains one step on a simulated drive, as on a machine with little installed.

Usage: bare_machine.py FOLDER. Beside torch it finds numpy, scipy, safetensors and embreex only.
"""

from __future__ import annotations

import sys
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

ABSENT = {
    "click", "evo", "kiss_icp", "laspy", "lazrs", "matplotlib", "open3d", "plyfile", "pyarrow",
    "small_gicp", "tomli", "tqdm",
}  # fmt: skip

find = PathFinder.find_spec


def find_what_is_there(name: str, *where: Any) -> Any:
    return None if name.partition(".")[0] in ABSENT else find(name, *where)


def main() -> None:
    import torch
    from toy import SMALL

    from lidaraccum.training.dataset import WindowSettings
    from lidaraccum.training.settings import TrainSettings
    from lidaraccum.training.trainer import train

    torch.set_num_threads(1)
    windows = WindowSettings(extent_m=16.0, lengths=(2,), windows_per_drive=1, drive_frames=2)
    train(
        TrainSettings(
            network=SMALL, windows=windows, steps=1, workers=0, validate_steps=0, log_steps=1,
            device="cpu",
        ),
        Path(sys.argv[1]),
    )  # fmt: skip


if __name__ == "__main__":
    PathFinder.find_spec = find_what_is_there  # type: ignore[method-assign, assignment]
    main()
