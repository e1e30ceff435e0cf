"""The run's diary: one JSON object a line, for losses and for scores."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path


class Journal:
    """Appends lines to ``metrics.jsonl``; a line is in the file when the call returns.

    Args:
        path: Of the file.
        step: Lines of later steps are from a life that was lost, and are dropped.
    """

    def __init__(self, path: Path, step: int) -> None:
        kept = []
        if step and path.is_file():
            for line in path.read_text().splitlines():
                try:
                    entry = json.loads(line)
                except json.JSONDecodeError:  # the line a kill cut short
                    continue
                if entry["step"] <= step:
                    kept.append(line)
        path.write_text("".join(f"{line}\n" for line in kept))
        self._path = path

    def note(self, kind: str, step: int, seconds: float, numbers: Mapping[str, float]) -> None:
        """One line: ``kind``, ``step``, ``seconds``, then the numbers, null where there is none."""
        entry = {"kind": kind, "step": step, "seconds": round(seconds, 1)}
        known = {
            name: round(value, 6) if math.isfinite(value) else None
            for name, value in numbers.items()
        }
        with self._path.open("a") as file:
            file.write(json.dumps(entry | known) + "\n")
