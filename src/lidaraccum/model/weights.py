"""Where the shipped weights are. Free of torch, so that asking costs nothing."""

from __future__ import annotations

import hashlib
from importlib.resources import files
from pathlib import Path

from lidaraccum.errors import MissingInputError

SUFFIX = ".safetensors"


def shipped_weights() -> Path | None:
    """The weights that came with the package; None where it came without."""
    folder = Path(str(files("lidaraccum"))) / "weights"
    return max(folder.glob(f"*{SUFFIX}"), default=None) if folder.is_dir() else None


def available_weights(path: Path | None) -> Path | None:
    """The weights a user named, else those shipped, else None."""
    return path or shipped_weights()


def chosen_weights(path: Path | None) -> Path:
    """As `available_weights`, which must be there.

    Raises:
        MissingInputError: There are none.
    """
    chosen = available_weights(path)
    if chosen is None:
        raise MissingInputError(
            "this installation came without weights", hint="--weights FILE names some"
        )
    if not chosen.is_file():
        raise MissingInputError(f"there is no file {chosen}")
    return chosen


def weights_hash(path: Path) -> str:
    """SHA-256 of the file, hexadecimal: what a report names."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
