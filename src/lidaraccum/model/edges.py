"""How far an object has gone, by its edges: each tells one way only, and not all can be trusted.

The mean of what is seen of a car wanders over it as it passes; its rear stays where it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import nn

from lidaraccum.model.tubes import LENGTH_M, Tubes, centroid_gap

DIRECTIONS = 16
"""Of the horizontal plane, evenly about, in which objects have edges."""
SHARES = (0.0, 0.03, 0.5)
"""So many of the points may lie beyond: the outermost has none, strays or a part that comes and
goes shift the second little, and the last is the middle."""

_AXES = DIRECTIONS // 2
"""An edge and the one opposite have one."""
_CIRCUMSTANCES = 10
_FURTHEST_M = 3.0
"""What one edge says beyond what the centroid says is told up to here."""
_NEAR_M = 0.1
"""Who went less than about this has no direction of going."""
_SURE = 8.0
"""At first the anchor's frame counts as so many others."""
_BREATH = 1e-3
"""Of the centroid, which decides where edges say nothing."""


class EdgeShift(nn.Module):
    """The shift that takes an object's edges at each time to those at its anchor's time.

    Edge k, outermost along n_k but for a share of the points, is g_k short of where it is at the
    anchor's time, so a shift s should have n_k s = g_k; the centroid asks for its own gap, in all
    directions. The shift is the least-squares answer. How much each counts is learned, the same
    function for all: an edge that is turned away from the sensor, that others hide, or that is a
    stray point, is no edge of the object. Upwards the answer lies between what the mean and the
    same shares from above and below say.
    """

    ways: torch.Tensor
    outside: torch.Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.told = nn.Linear(channels, 32)
        self.seen = nn.Linear(_CIRCUMSTANCES, 32)
        last = nn.Linear(32, 1)
        nn.init.normal_(last.weight, std=1e-3)  # all edges alike at first
        self.trust = nn.Sequential(
            nn.ReLU(inplace=True), nn.Linear(32, 32), nn.ReLU(inplace=True), last
        )
        self.centre = nn.Linear(channels, 1)
        self.height = nn.Linear(channels, 1 + 2 * len(SHARES))
        ways = _directions().repeat(len(SHARES), 1)
        self.register_buffer("ways", ways, persistent=False)
        outside = torch.tensor(SHARES).repeat_interleave(DIRECTIONS)
        self.register_buffer("outside", outside, persistent=False)

    def forward(
        self, tubes: Tubes, said: torch.Tensor, moved: torch.Tensor, gone: torch.Tensor
    ) -> torch.Tensor:
        """Shifts (K, T, 3), metres; 0 for times an object was not seen.

        Args:
            tubes: Points of K objects over T times.
            said: (K, T, C) what TubeNet thinks of each.
            moved: (Q, 3) the points about their anchors, moved so far.
            gone: (K, T, 3) metres they were shifted so far.
        """
        gap = centroid_gap(moved, tubes)
        along = torch.cat([moved[:, :2] @ self.ways[:_AXES].T, moved[:, 2:]], dim=1)
        above, below = (
            reached.view(*tubes.counts.shape, len(SHARES), -1)
            for reached in _ends(along, tubes.slot(), tubes.counts.flatten(), SHARES)
        )
        reach = torch.cat([above[..., :_AXES], below[..., :_AXES]], dim=3).flatten(2)
        upward = torch.stack([above[..., -1], -below[..., -1]], dim=3).flatten(2)
        seen = (tubes.counts > 0)[..., None]
        ahead = torch.where(seen, tubes.at_anchor(reach) - reach, 0.0)
        circumstances = self._describe(tubes, gap, reach, ahead, gone)
        told = self.told(said)[:, :, None] + self.seen(circumstances)
        trust = torch.cat([self.centre(said), self.trust(told)[..., 0]], dim=2).softmax(dim=2)
        rise = torch.where(seen, tubes.at_anchor(upward) - upward, 0.0)
        rise = torch.cat([gap[..., 2:], rise], dim=2)
        height = (self.height(said).softmax(dim=2) * rise).sum(dim=2, keepdim=True)
        return torch.cat([self._solve(trust, ahead, gap[..., :2]), height], dim=2)

    def _describe(
        self,
        tubes: Tubes,
        gap: torch.Tensor,
        reach: torch.Tensor,
        ahead: torch.Tensor,
        gone: torch.Tensor,
    ) -> torch.Tensor:
        """(K, T, E, 10): what tells whether an edge can be trusted, seen along its direction."""
        by_share = reach.view(*reach.shape[:2], len(SHARES), DIRECTIONS)
        across = (by_share + torch.roll(by_share, _AXES, dims=3)).flatten(2)
        depth = (by_share[:, :, :1] - by_share).flatten(2)
        going = gap[..., :2] + gone[..., :2]
        going = going / torch.linalg.vector_norm(going, dim=2, keepdim=True).clamp_min(_NEAR_M)
        bearing = tubes.bearing() @ self.ways.T
        beyond = ahead - gap[..., :2] @ self.ways.T
        return torch.stack(
            [
                beyond.clamp(-_FURTHEST_M, _FURTHEST_M),
                bearing[:, None].expand_as(reach),
                going @ self.ways.T,
                across / LENGTH_M,
                reach / LENGTH_M,
                tubes.plenty()[..., None].expand_as(reach),
                ahead.clamp(-_FURTHEST_M, _FURTHEST_M),
                depth / LENGTH_M,
                tubes.at_anchor(depth).expand_as(reach) / LENGTH_M,
                self.outside.expand_as(reach),
            ],
            dim=3,
        )

    def _solve(self, trust: torch.Tensor, ahead: torch.Tensor, gap: torch.Tensor) -> torch.Tensor:
        """(K, T, 2): weighted least squares over the centroid's say and each edge's."""
        centre, edges = trust[..., :1] + _BREATH, trust[..., 1:]
        ways = self.ways
        aim = (edges * ahead) @ ways + centre * gap
        xx, xy, yy = (
            edges @ (ways[:, i] * ways[:, j]) + (centre[..., 0] if i == j else 0.0)
            for i, j in ((0, 0), (0, 1), (1, 1))
        )
        x, y = aim.unbind(dim=2)
        whole = xx * yy - xy * xy
        return torch.stack([(yy * x - xy * y) / whole, (xx * y - xy * x) / whole], dim=2)


class StraightOn(nn.Module):
    """Draws an object's shifts towards those of steady motion, as far as that is to be believed.

    Frames err each in its own way, and few objects change their speed within half a second. The
    anchor's frame errs too: what all others have in common beside their motion is taken for its
    error, as far as it is learned that it may be.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.say = nn.Linear(channels, 2)
        self.sure = nn.Linear(channels, 1)
        for layer in (self.say, self.sure):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)

    def forward(self, tubes: Tubes, said: torch.Tensor, gone: torch.Tensor) -> torch.Tensor:
        """What to add (K, T, 3), metres, to how far objects have gone.

        Args:
            tubes: Points of K objects over T times.
            said: (K, T, C) what TubeNet thinks of each.
            gone: (K, T, 3) metres from each time to the anchor's.
        """
        count, drawn = self.say(said).sigmoid().unbind(dim=2)
        seconds = tubes.seconds_by_time()
        count = torch.where(tubes.fixed(), 0.0, count)
        # Least squares of a steady motion and one shift of all, which costs its square.
        cost = _SURE * self.sure(tubes.at_anchor(said))[:, 0].exp()
        share = (count * seconds).sum(dim=1, keepdim=True)
        share = share / (count.sum(dim=1, keepdim=True) + cost)
        ways = ((count * seconds)[..., None] * gone).sum(dim=1)
        ways = ways - share * (count[..., None] * gone).sum(dim=1)
        spans = (count * seconds**2).sum(dim=1, keepdim=True)
        spans = spans - share * (count * seconds).sum(dim=1, keepdim=True)
        velocity = ways / (spans + 1e-6)
        return drawn[..., None] * (velocity[:, None] * seconds[..., None] - gone)


def _directions() -> torch.Tensor:
    """(DIRECTIONS, 2) unit vectors, evenly about; the second half is opposite the first."""
    angle = torch.arange(DIRECTIONS) * (2.0 * math.pi / DIRECTIONS)
    return torch.stack([torch.cos(angle), torch.sin(angle)], dim=1)


def _ends(
    values: torch.Tensor, slot: torch.Tensor, counts: torch.Tensor, shares: Sequence[float]
) -> tuple[torch.Tensor, torch.Tensor]:
    """How far values (Q, A) of each slot reach, upwards and downwards: twice (S, R, A).

    Args:
        values: (Q, A).
        slot: (Q,) int64, 0..S-1.
        counts: (S,) int64 of values in each; where there are none the answer is 0.
        shares: R shares of a slot's values that may lie beyond.
    """
    if len(slot) == 0:
        nothing = values.new_zeros(len(counts), len(shares), values.shape[1])
        return nothing, nothing
    # Objects lie within kilometres: one number sorts by slot, then by value.
    order = torch.argsort(values.T.double() + 1e5 * slot, dim=1)
    ranked = values.T.gather(1, order)
    last = torch.cumsum(counts, dim=0)[:, None] - 1
    beyond = (counts[:, None] * counts.new_tensor(shares, dtype=torch.float64)).floor().long()
    upper, lower = last - beyond, last - counts[:, None] + 1 + beyond
    seen = (counts > 0)[:, None, None]
    above, below = (
        torch.where(seen, sign * ranked[:, index.clamp(0, len(slot) - 1)].permute(1, 2, 0), 0.0)
        for index, sign in ((upper, 1.0), (lower, -1.0))
    )
    return above, below
