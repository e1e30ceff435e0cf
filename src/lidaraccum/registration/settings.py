"""The numbers of registration, each with its unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lidaraccum.errors import SettingsError


@dataclass(frozen=True)
class RegistrationSettings:
    """What registration may be told; the defaults are meant for any spinning sensor.

    Attributes:
        deskew: ``auto`` undoes the motion within a sweep where the points show it; ``off`` never.
        poses_mode: What given poses are for: ``given`` uses them unchanged and only measures how
            well they fit, ``refine`` starts from them.
        voxel_m: Edge of the map's finest voxels; two coarser levels double it.
        source_voxel_m: One point per such voxel of a frame is aligned.
        dense_voxel_m: One point per such voxel has the last word on a pose: few points' noise alone
            moves it by millimetres.
        min_range_m: Nearer points are the car that carries the sensor.
        max_range_m: Farther points are left out of registration (never out of the result).
        lookahead: Frames solved together at the start, so that the first one is right at speed.
        max_speed_mps: Faster motions are not proposed and are called doubtful.
        max_turn_dps: The same for turning, degrees a second.
        min_overlap: A registration with a smaller share of partners is doubtful.
        ambiguity: Two distinct motions whose scores differ by less than this share are doubtful.
    """

    deskew: Literal["auto", "off"] = "auto"
    poses_mode: Literal["given", "refine"] = "given"
    voxel_m: float = 0.5
    source_voxel_m: float = 1.0
    dense_voxel_m: float = 0.15
    min_range_m: float = 2.5
    max_range_m: float = 100.0
    lookahead: int = 5
    max_speed_mps: float = 40.0
    max_turn_dps: float = 50.0
    min_overlap: float = 0.25
    ambiguity: float = 0.02

    def __post_init__(self) -> None:
        if self.deskew not in ("auto", "off"):
            raise SettingsError(f"deskew must be auto or off, not {self.deskew!r}")
        if self.poses_mode not in ("given", "refine"):
            raise SettingsError(f"poses mode must be given or refine, not {self.poses_mode!r}")
        for name in (
            "voxel_m",
            "source_voxel_m",
            "dense_voxel_m",
            "max_range_m",
            "max_speed_mps",
            "max_turn_dps",
        ):
            if not getattr(self, name) > 0:
                raise SettingsError(f"{name} must be positive, not {getattr(self, name)}")
        if not 0 <= self.min_range_m < self.max_range_m:
            raise SettingsError("min_range_m must lie between 0 and max_range_m")
        if self.lookahead < 2:
            raise SettingsError("a lookahead of fewer than 2 frames cannot start at speed")
