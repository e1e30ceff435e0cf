"""One made-up street in the schemas of three data sets."""

from __future__ import annotations

from pathlib import Path

from driving_logs.argoverse2 import write_argoverse2
from driving_logs.nuscenes import write_nuscenes
from driving_logs.street import (
    MOVER,
    PARKED,
    SIGN,
    THINGS,
    WALKER,
    Written,
    vehicle_at,
)
from driving_logs.waymo import write_waymo

__all__ = ["MOVER", "PARKED", "SIGN", "THINGS", "WALKER", "Written", "vehicle_at", "write"]


def write(kind: str, root: Path) -> Written:
    """Write one of the data sets into a folder."""
    return {"nuscenes": write_nuscenes, "waymo": write_waymo, "argoverse2": write_argoverse2}[kind](
        root
    )
