"""The network's numbers, carried inside its checkpoint."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lidaraccum.errors import SettingsError

COARSEST_CELLS = 16
"""Grid sides are multiples of this, so that every level of both U-Nets halves evenly."""

EFFORT = (
    "extent_m", "pillar_points", "ego_pillars", "ground_pillars", "finer_m", "glance_odds",
    "beside_odds",
)  # fmt: skip
"""Settings that say how much is looked at. Weights fit any, best those they learned with."""

TUBES = ("sides", "overlap")
"""Kinds of TubeNet: the second asks all that the first asks, and one thing more."""


@dataclass(frozen=True)
class NetworkSettings:
    """What shapes the network; its weights fit only the same settings, but for `EFFORT`.

    Attributes:
        pillar_m: Side of a pillar, metres.
        extent_m: Side of the square grid about the sensor, metres, unless the caller asks for
            another; the weights fit any.
        lowest_m: Points lower than this above the ground are left out.
        highest_m: Points higher than this above the ground are left out.
        pillar_points: Points that tell of a pillar; of one that has more, so many; 0 for all.
        point_hidden: Channels between the two layers of the point-wise MLP.
        pillar_channels: Channels of a pillar before its projection.
        base_widths: Channels of the base U-Net by level, each half the size of the one before;
            the first is that of the base features.
        ego_channels: Channels of the ego features.
        ego_pillars: Background pillars matched in each frame.
        ground_pillars: Pillars of the ground that tell how high and how level each frame lies.
        standing_odds: How much rather than the road, which looks alike everywhere but of which
            there is far more, a pillar that stands out of it is drawn to be matched.
        slack_start: Where the slack of the pillars' affinity starts, before softplus.
        scale_start: Where its temperature starts, as a logarithm: lower is sharper. Fresh features,
            a good deal apart for any two places, must match a little (else there is no gradient)
            but mostly where they are alike (a soft start does not learn).
        sinkhorn_rounds: Row and column normalisations.
        fastest_mps: Nothing is matched to what it could only reach faster.
        rematch_m: How far a pillar may lie from its partner each time it is matched again, metres.
        finer_m: The same of further times, which training goes without: they match as the last of
            ``rematch_m`` has learned to.
        glance_odds: Of pillars that seem background in their own frame, one point is looked at in
            the whole window, where the odds that they are not are no less than this.
        beside_odds: The same of pillars within 2 m of what moves in their frame, which are looked
            at if that point moves.
        temporal_channels: Channels of the temporal block, at half the grid's resolution.
        temporal_blocks: How many of them.
        temporal: How a window's frames are put together: ``max``, the largest of what they say, or
            ``decay``, the target and the others' differences from it, the nearer in time the more.
        motion_widths: Channels of the motion U-Net by level, from half resolution on; the first
            is that of the motion features.
        point_channels: Channels of a point's motion features.
        tube: How an object's motion is had, one of `TUBES`: by its sides and edges, or by how much
            of it then overlaps with itself, too; see `model.tube_net`.
        tube_channels: Channels of what TubeNet says of an object's positions in one frame.
    """

    pillar_m: float = 0.25
    extent_m: float = 64.0
    lowest_m: float = -2.0
    highest_m: float = 6.0
    pillar_points: int = 16
    point_hidden: int = 32
    pillar_channels: int = 48
    base_widths: tuple[int, ...] = (32, 64, 128, 192, 256)
    ego_channels: int = 64
    ego_pillars: int = 1024
    ground_pillars: int = 4096
    standing_odds: float = 16.0
    slack_start: float = -1.0
    scale_start: float = -3.0
    sinkhorn_rounds: int = 3
    fastest_mps: float = 40.0
    rematch_m: tuple[float, ...] = (3.0, 1.5, 0.7)
    finer_m: tuple[float, ...] = (0.7, 0.4, 0.4, 0.4)
    glance_odds: float = 0.1
    beside_odds: float = 0.01
    temporal_channels: int = 48
    temporal_blocks: int = 2
    temporal: str = "max"
    motion_widths: tuple[int, ...] = (64, 96, 128, 160)
    point_channels: int = 128
    tube: str = "overlap"
    tube_channels: int = 128

    def __post_init__(self) -> None:
        # A checkpoint's JSON brings lists.
        object.__setattr__(self, "base_widths", tuple(self.base_widths))
        object.__setattr__(self, "rematch_m", tuple(self.rematch_m))
        object.__setattr__(self, "finer_m", tuple(self.finer_m))
        object.__setattr__(self, "motion_widths", tuple(self.motion_widths))
        if not 2 <= len(self.base_widths) <= 5 or not 2 <= len(self.motion_widths) <= 4:
            raise SettingsError("a U-Net has 2 to 5 levels (base), 2 to 4 (motion)")
        if self.temporal not in ("max", "decay"):
            raise SettingsError(f"temporal is max or decay, not {self.temporal!r}")
        if self.tube not in TUBES:
            raise SettingsError(f"tube is one of {', '.join(TUBES)}, not {self.tube!r}")
        if min(self.standing_odds, self.glance_odds, self.beside_odds) <= 0.0:
            raise SettingsError("standing_odds, glance_odds and beside_odds are more than 0")
        if self.lowest_m >= self.highest_m:
            raise SettingsError("lowest_m must be below highest_m")
        self.cells(self.extent_m)

    def with_effort(self, other: NetworkSettings) -> NetworkSettings:
        """These settings with another's `EFFORT`."""
        return replace(self, **{name: getattr(other, name) for name in EFFORT})

    def cells(self, extent_m: float) -> int:
        """Cells along one side of a square grid of this extent, metres.

        Raises:
            SettingsError: The grid cannot be halved evenly down to the coarsest level.
        """
        cells = round(extent_m / self.pillar_m)
        if cells <= 0 or cells % COARSEST_CELLS or abs(cells * self.pillar_m - extent_m) > 1e-6:
            raise SettingsError(
                f"the grid's extent must be a multiple of {COARSEST_CELLS * self.pillar_m:g} m, "
                f"not {extent_m:g} m"
            )
        return cells
