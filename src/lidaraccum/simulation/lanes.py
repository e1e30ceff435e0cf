"""Vehicles that follow each other along a lane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STANDSTILL_M = 2.0
COMFORT_MPS2 = 2.0


@dataclass(frozen=True, eq=False)
class Column:
    """Vehicles one behind another, foremost first.

    Attributes:
        start: (N,) metres along the lane at the first time.
        speed: (N,) m/s at the first time.
        wanted: (N,) m/s each would drive alone.
        length: (N,) metres.
        headway: (N,) seconds each keeps to the one ahead.
        waits: (N,) seconds before which a vehicle that stands does not leave.
    """

    start: Array
    speed: Array
    wanted: Array
    length: Array
    headway: Array
    waits: Array


def drive_column(column: Column, times: Array, leader: Array | None, leader_m: float) -> Array:
    """Metres (K, N) along the lane of each vehicle by the intelligent driver model.

    Args:
        column: The vehicles.
        times: (K,) seconds, equally spaced.
        leader: (K,) metres along the lane of one ahead of them all, or None.
        leader_m: Its length.

    Source: Treiber, Hennecke, Helbing (2000), Congested traffic states, eq. 3.
    """
    step = float(times[1] - times[0])
    along, speed = column.start.copy(), column.speed.copy()
    track = np.zeros((len(times), len(along)))
    ahead_m = np.concatenate([[leader_m], column.length[:-1]])
    old_leader = None if leader is None else leader[0]
    for index, time in enumerate(times):
        track[index] = along
        lead = 1e6 if leader is None else leader[index]
        lead_speed = 40.0 if leader is None or old_leader is None else (lead - old_leader) / step
        old_leader = None if leader is None else lead
        place = np.concatenate([[lead], along[:-1]])
        pace = np.concatenate([[max(lead_speed, 0.0)], speed[:-1]])
        gap = np.maximum(place - along - 0.5 * (ahead_m + column.length), 0.3)
        wish = STANDSTILL_M + speed * column.headway + speed * (speed - pace) / (2 * 1.7)
        push = 1 - (speed / np.maximum(column.wanted, 0.5)) ** 4 - (np.maximum(wish, 0) / gap) ** 2
        change = np.clip(1.5 * push, -6.0, COMFORT_MPS2)
        change = np.where(time < column.waits, np.minimum(change, 0.0), change)
        new_speed = np.maximum(speed + change * step, 0.0)
        along = along + 0.5 * (speed + new_speed) * step
        speed = new_speed
    return track
