"""Which columns an output has: fixed by its first frame, kept by every later one."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.accumulation import AccumulatedFrame

logger = logging.getLogger(__name__)

OWN_FIELDS = ("frame", "label", "instance", "confidence", "time")
RESERVED = frozenset({*OWN_FIELDS, "points", "x", "y", "z"})


@dataclass(frozen=True, eq=False)
class Chunk:
    """One frame's share, made to fit the output's columns.

    Attributes:
        points: (M, 3) float64, metres, in the reference frame.
        own: `OWN_FIELDS` by name, (M,) each; ``time`` in seconds from the output's time origin.
        attributes: The schema's attributes, (M,) each, in the schema's types and order.
    """

    points: NDArray[np.float64]
    own: dict[str, NDArray[Any]]
    attributes: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.points)


class Schema:
    """The attributes of an output, by name, with their types.

    Attributes:
        types: The attributes' types by name, in the first frame's order.
        file_names: For each own field and attribute, a name without blanks, no two alike.
        time_origin: Seconds: what ``time`` counts from.
    """

    def __init__(self, types: Mapping[str, np.dtype[Any]], time_origin: float) -> None:
        self.types = {n: writable_type(kind) for n, kind in types.items() if n not in RESERVED}
        self.file_names = distinct_names([*OWN_FIELDS, *self.types])
        self.time_origin = time_origin
        self._said: set[str] = set()

    def chunk(self, frame: AccumulatedFrame) -> Chunk:
        """The frame in the schema's columns: missing ones filled, unknown ones dropped, both said.

        A missing column becomes NaN, or 0 where the type has no NaN.
        """
        own: dict[str, NDArray[Any]] = {
            "frame": np.full(len(frame), frame.index, np.int32),
            **{name: getattr(frame, name) for name in OWN_FIELDS[1:]},
        }
        attributes = {}
        for name, kind in self.types.items():
            values = frame.attributes.get(name)
            if values is None:
                self.say_once(f"frame {frame.index} has no {name}: filled with NaN or 0")
                values = np.full(len(frame), np.nan if kind.kind == "f" else 0, kind)
            attributes[name] = self._cast(name, values, kind)
        for name in frame.attributes.keys() - self.types.keys():
            self.say_once(f"{name} is left out: the output's first frame has no such column", name)
        return Chunk(frame.points, own, attributes)

    def _cast(self, name: str, values: NDArray[Any], kind: np.dtype[Any]) -> NDArray[Any]:
        if values.dtype == kind:
            return values
        with np.errstate(invalid="ignore", over="ignore"):
            cast = _within(values, kind).astype(kind)
        if values.dtype != np.float16 and not np.array_equal(
            cast, values, equal_nan=kind.kind == "f"
        ):
            self.say_once(f"{name} of some frames does not fit {kind}: changed", name)
        return cast

    def say_once(self, sentence: str, key: str = "") -> None:
        """Log a warning, the first time only."""
        key = key or sentence.split(" has ")[-1]
        if key not in self._said:
            self._said.add(key)
            logger.warning(sentence)


def _within(values: NDArray[Any], kind: np.dtype[Any]) -> NDArray[Any]:
    """Values cut off at what an integer type holds, so that none wraps around."""
    if kind.kind not in "iu":
        return values
    limits = np.iinfo(kind)
    known = np.nan_to_num(values) if values.dtype.kind == "f" else values
    return np.clip(known, limits.min, limits.max)


def writable_type(kind: np.dtype[Any]) -> np.dtype[Any]:
    """The type a column is written in: bool as uint8, half floats as float32."""
    if kind.kind == "b":
        return np.dtype(np.uint8)
    if kind == np.float16:
        return np.dtype(np.float32)
    return kind.newbyteorder("=")


def distinct_names(names: list[str]) -> dict[str, str]:
    """For each name one that can stand in a header of words, no two alike."""
    chosen: dict[str, str] = {}
    for name in names:
        free = file_name_of(name)
        while free in chosen.values():
            free += "_"
        chosen[name] = free
    return chosen


def file_name_of(name: str) -> str:
    """An attribute's name without what headers of plain words cannot hold: blanks, non-ASCII."""
    word = "_".join(name.split()) or "unnamed"
    return "".join(letter if letter.isascii() else f"u{ord(letter):04x}" for letter in word)
