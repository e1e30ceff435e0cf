"""What a user may say about an input, checked when said."""

from __future__ import annotations

from dataclasses import dataclass

from lidaraccum.errors import SettingsError
from lidaraccum.io.listing import FORMATS

AUTO_POSES = "auto"
DEFAULT_RATE_HZ = 10.0


@dataclass(frozen=True)
class InputSettings:
    """How to read a sequence.

    Attributes:
        rate_hz: Frames a second; overrules the times that are found. None: as found, else 10.
        bin_fields: Names of the float32 fields of ``.bin`` files, ``x``, ``y``, ``z`` among them.
        split_by: Dimension of the one LAS file that tells its frames apart:
            ``point_source_id``, ``gps_time`` or any other.
        poses: ``auto`` for the poses that lie beside the frames, a path, or empty for none.
        frames: Which frames, as a slice ``a:b:c``; empty for all.
        format: Which format where a folder mixes them; None when it does not.
    """

    rate_hz: float | None = None
    bin_fields: tuple[str, ...] = ()
    split_by: str | None = None
    poses: str = ""
    frames: str = ""
    format: str | None = None

    def __post_init__(self) -> None:
        if self.rate_hz is not None and not 0 < self.rate_hz < 1e4:
            raise SettingsError(f"the rate must be positive, not {self.rate_hz}")
        if self.format is not None and self.format not in FORMATS:
            raise SettingsError(
                f"unknown format {self.format}", hint=f"known: {', '.join(sorted(FORMATS))}"
            )
        if self.bin_fields:
            check_bin_fields(self.bin_fields)
        selection(self.frames)


def check_bin_fields(fields: tuple[str, ...]) -> None:
    """Raise SettingsError unless the names are distinct and hold x, y and z."""
    missing = [axis for axis in "xyz" if axis not in fields]
    if missing:
        raise SettingsError(
            f"--bin-fields lacks {', '.join(missing)}", hint="such as x,y,z,intensity,ring,t"
        )
    if len(set(fields)) < len(fields) or "" in fields:
        raise SettingsError(f"--bin-fields must be distinct names, not {','.join(fields)}")


def selection(text: str) -> slice:
    """The slice that ``a:b:c`` stands for; ``7`` is frame 7 alone.

    Raises:
        SettingsError: No slice, or one that runs backwards.
    """
    try:
        numbers = [int(part) if part.strip() else None for part in text.split(":")]
    except ValueError:
        numbers = []
    if not text:
        return slice(None)
    if len(numbers) == 1 and numbers[0] is not None:
        first = numbers[0]
        return slice(first, first + 1 if first != -1 else None)
    step = numbers[2] if len(numbers) == 3 else None
    if not 2 <= len(numbers) <= 3 or (step is not None and step <= 0):
        raise SettingsError(f"frames must be a slice a:b or a:b:c with c > 0, not {text!r}")
    return slice(*numbers)
