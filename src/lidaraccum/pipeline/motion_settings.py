"""The numbers that decide what is called moving, and three ways of setting them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lidaraccum.errors import SettingsError

LIKELY, SURE = 0.5, 0.8
TRUSTED_MARGIN = 0.2
TRUSTED_COST = 0.65
TRUSTED_SHARE = 0.85
TRUSTED_WAY = 0.5
TRUSTED_SHOWN, LIKELY_SHOWN = 0.08, 0.2
"""Where a proposer thinks it so likely that something moves, this share of the margin is enough and
this cost is allowed if it is less than this share of standing still; so is this share of the way.
So much of it must be shown, not hidden, less where he is sure: a wall that comes into view may have
come from anywhere."""


@dataclass(frozen=True)
class MotionSettings:
    """How movers are found from geometry alone.

    A cost is a mean over a cluster's points and the window's other frames: 0 for a perfect partner,
    1 at ``truncation_m`` from any, more where a frame saw through the place.

    Attributes:
        window: Frames looked at together.
        stride: Frames from one window to the next.
        min_range_m: Nearer points are the car that carries the sensor.
        min_height_m: Lower points are ground.
        max_height_m: Higher points are no part of a mover.
        cell_m: Points whose cells of this width touch are one cluster.
        seeds: Points seen through that make a cluster suspect.
        seed_share: Share of a cluster's points that must be seen through for the whole of it to be
            suspect; with less, only what was seen through is.
        min_points: A mover has so many points in its best frame.
        min_speed_mps: Slower things stand still.
        max_speed_mps: Faster things are not proposed.
        min_shift_m: A mover goes so far within the window.
        truncation_m: Distance at which a point has no partner.
        margin: How much less than standing still a motion must cost.
        max_cost: A motion that costs more explains nothing.
        max_share: Nor does one that costs more than this share of what standing still costs.
        min_through: Share of its points that the other frames must have seen through, were it
            standing still.
        shown: Or so much more must standing still cost where nothing is hidden: what creeps is
            never seen through.
        min_shown: And at least so much.
        sure_margin: With so much margin one window is enough; with less, two must agree.
        box_growth: A mover takes all that is inside the box of what it has shown, unless that
            makes so many times its points.
    """

    window: int = 9
    stride: int = 4
    min_range_m: float = 2.5
    min_height_m: float = 0.25
    max_height_m: float = 4.5
    cell_m: float = 0.3
    seeds: int = 4
    seed_share: float = 0.25
    min_points: int = 8
    min_speed_mps: float = 0.5
    max_speed_mps: float = 35.0
    min_shift_m: float = 0.3
    truncation_m: float = 0.3
    margin: float = 0.3
    max_cost: float = 0.5
    max_share: float = 1.0
    min_through: float = 0.15
    shown: float = 0.3
    min_shown: float = 0.0
    sure_margin: float = 0.5
    box_growth: float = 1.5

    def __post_init__(self) -> None:
        if self.window < 2:
            raise SettingsError(f"a window takes at least 2 frames, not {self.window}")
        if not 1 <= self.stride < self.window:
            raise SettingsError(
                f"windows must share a frame: stride {self.stride}, window {self.window}"
            )

    def trusting(self, trust: float) -> MotionSettings:
        """What a mover must show whose proposer trusts it so much, 0..1: less, but never nothing.

        Moving must still explain the points better than standing, but nobody need have seen
        through its place.
        """
        return replace(
            self,
            margin=TRUSTED_MARGIN * self.margin,
            max_cost=max(TRUSTED_COST, self.max_cost),
            max_share=TRUSTED_SHARE,
            min_shift_m=TRUSTED_WAY * self.min_shift_m,
            min_through=-1.0,
            min_shown=TRUSTED_SHOWN if trust >= SURE else LIKELY_SHOWN,
        )


CONSERVATIVE = MotionSettings(
    margin=0.4,
    max_cost=0.4,
    min_through=0.25,
    shown=0.5,
    min_points=15,
    sure_margin=9.0,
    box_growth=1.0,
)
BALANCED = MotionSettings()
AGGRESSIVE = MotionSettings(
    margin=0.2,
    max_cost=0.6,
    min_through=0.05,
    shown=0.2,
    min_points=5,
    seeds=2,
    sure_margin=0.0,
    box_growth=3.0,
)
PRESETS = {"conservative": CONSERVATIVE, "balanced": BALANCED, "aggressive": AGGRESSIVE}
"""From what is called moving surely is, to what moves is surely called so."""
