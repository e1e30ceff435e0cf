"""When each point was measured: finding the column, its unit, and what it counts from.

The rule, for every column called like a time: its unit is the one of s, ms, us, ns by which the
points of the frame span between 10 ms and one and a half frame periods (at least 0.15 s); at most
one does. A column for which none does, a constant one among them, is no time. Seconds
within one and a half periods of zero count from the frame's stamp; seconds that near to the stamp
count from where the stamp does; otherwise the points have a clock of their own: it gives the stamp
where none was recorded, and else the first point is taken to be measured at the stamp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import BoolArray

TIME_NAMES = (
    "t",
    "time",
    "timestamp",
    "offset_time",
    "time_offset",
    "time_stamp",
    "gps_time",
    "gpstime",
    "scalar_time",
    "input_time",
)
UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)
SHORTEST_SPAN_S = 1e-2
SHORTEST_PERIOD_S = 0.1
ROTATIONS = 1.5
"""How much of a rotation one frame may span."""


@dataclass(frozen=True, eq=False)
class PointTime:
    """When the points were measured.

    Attributes:
        stamp: Seconds, of the frame.
        offset: (N,) float64 seconds from ``stamp``, or None.
        column: The column's name in the file, empty when there is none.
        own_clock: The stamp was read off the points.
    """

    stamp: float
    offset: NDArray[np.float64] | None = None
    column: str = ""
    own_clock: bool = False


@dataclass(frozen=True)
class Clock:
    """A column that is a time.

    Attributes:
        column: Its name in the file.
        unit_s: Seconds per unit.
        longest_s: How far from zero or from the stamp a time may be and still count from it.
    """

    column: str
    unit_s: float
    longest_s: float


def find_time(
    attributes: Mapping[str, NDArray[Any]],
    returned: BoolArray,
    stamp: float,
    period_s: float,
    exact: bool,
) -> PointTime:
    """Find the time of each point among the columns (N,), by the module's rule."""
    by_lower = {name.lower(): name for name in attributes}
    longest = ROTATIONS * max(period_s, SHORTEST_PERIOD_S)
    for name in TIME_NAMES:
        column = by_lower.get(name)
        if column is None:
            continue
        values = attributes[column]
        unit = unit_of(values[returned], longest)
        if unit is not None:
            return placed(values, returned, Clock(column, unit, longest), stamp, exact)
    return PointTime(stamp)


def unit_of(values: NDArray[Any], longest_s: float) -> float | None:
    """Seconds per unit of the column (M,), or None when it is no time."""
    if not len(values) or values.dtype.kind not in "fiu" or not np.isfinite(values).all():
        return None
    span = float(values.max() - values.min())
    return next((u for u in UNITS_S if SHORTEST_SPAN_S <= span * u <= longest_s), None)


def placed(
    values: NDArray[Any], returned: BoolArray, clock: Clock, stamp: float, exact: bool
) -> PointTime:
    """The times (N,) as seconds from the frame's stamp."""
    first = values[returned].min()
    # Differences first: seconds since 1970 in nanoseconds do not fit float64.
    if values.dtype.kind == "u":
        since_first = (values - first).astype(np.int64) * clock.unit_s
    else:
        since_first = (values - first).astype(np.float64) * clock.unit_s
    start = float(first) * clock.unit_s
    end = start + float(since_first[returned].max())
    if start >= -clock.longest_s and end <= clock.longest_s:
        return PointTime(stamp, since_first + start, clock.column)
    if abs(start - stamp) <= clock.longest_s:
        return PointTime(stamp, since_first + (start - stamp), clock.column)
    if exact:
        return PointTime(stamp, since_first, clock.column)
    return PointTime(start, since_first, clock.column, own_clock=True)
