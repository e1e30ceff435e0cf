"""How fast an object turns, by the ways its sides face.

Seen from above, the points of a side lie on a line: projected across it they heap up. How heaped
they are by direction is a figure of the object that turns as it does, whatever is seen of its ends.
"""

from __future__ import annotations

import math

import torch
from torch import nn

from lidaraccum.model.tubes import Tubes, centre_by_time, some_of_each
from lidaraccum.model.unet import deciding

DIRECTIONS = 90
"""Of half a turn, evenly about, across which points are projected."""
BIN_M = 0.15
_BINS = 96
_MOST_POINTS = 256
"""So many of an object's points at one time tell how it lies, or up to twice as many less one."""
_FEWEST_POINTS = 20

FASTEST_RAD_S = 1.2
_RATES = 97
_SHARPNESS = 60.0
_STRAIGHT = 5.0
_USUAL_RAD_S = 0.6
"""At first: what agreement counts, how much likelier it is not to turn, how fast turners turn."""
_STRAIGHT_RAD_S = 0.04
_CIRCUMSTANCES = 4


class SideTurn(nn.Module):
    """The turn that takes an object's sides at each time to where they faced at its anchor's time.

    Of steady rates of turning, the one by which the figures of all times agree best with that of
    the anchor's; agreement is weighed against how few objects turn. How much either counts is
    learned.
    """

    rates: torch.Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.say = deciding(channels + _CIRCUMSTANCES, 3)  # all objects alike at first
        rates = torch.linspace(-FASTEST_RAD_S, FASTEST_RAD_S, _RATES)
        self.register_buffer("rates", rates, persistent=False)

    def forward(self, tubes: Tubes, said: torch.Tensor, moved: torch.Tensor) -> torch.Tensor:
        """Turns (K, T) about the vertical, radians; 0 at the anchor's time.

        Args:
            tubes: Points of K objects over T times.
            said: (K, T, C) what TubeNet thinks of each.
            moved: (Q, 3) the points about their anchors, moved so far.
        """
        with torch.no_grad():
            agreement = self._agreement(tubes, moved)
        known = [said.mean(dim=1), *self._describe(tubes, agreement)]
        sharper, straighter, wider = self.say(torch.cat(known, dim=1)).exp().unbind(dim=1)
        straight = -0.5 * (self.rates / _STRAIGHT_RAD_S) ** 2 + _STRAIGHT * straighter[:, None]
        turning = -0.5 * (self.rates / (_USUAL_RAD_S * wider[:, None])) ** 2
        odds = _SHARPNESS * sharper[:, None] * agreement + torch.logaddexp(straight, turning)
        rate = (odds.softmax(dim=1) * self.rates).sum(dim=1)
        return torch.where(tubes.fixed(), 0.0, -rate[:, None] * tubes.seconds_by_time())

    def _describe(self, tubes: Tubes, agreement: torch.Tensor) -> list[torch.Tensor]:
        """(K, 4): how well the best rate agrees and none at all, how much is seen, how long."""
        best, none = agreement.amax(dim=1), agreement[:, len(self.rates) // 2]
        seconds = tubes.seconds_by_time()
        span = seconds.amax(dim=1) - seconds.amin(dim=1)
        described = [best, none, tubes.plenty().mean(dim=1), span]
        return [one[:, None] for one in described]

    def _agreement(self, tubes: Tubes, moved: torch.Tensor) -> torch.Tensor:
        """(K, R) -1..1: how well figures agree if an object turned at each of the rates."""
        count, span = tubes.counts.shape
        centres = centre_by_time(moved, tubes)[..., :2].reshape(-1, 2)
        slot = tubes.slot()
        heaped = _heaps(moved[:, :2] - centres[slot], slot, tubes.counts.flatten())
        figure = heaped - heaped.mean(dim=1, keepdim=True)
        figure = nn.functional.normalize(figure, dim=1).view(count, span, DIRECTIONS)
        home = torch.fft.rfft(tubes.at_anchor(figure))
        by_step = torch.fft.irfft(home * torch.fft.rfft(figure).conj(), n=DIRECTIONS)
        steps = -self.rates * tubes.seconds_by_time()[..., None] * (DIRECTIONS / math.pi)
        low = steps.floor()
        share = steps - low
        near, far = (by_step.gather(2, (low.long() + one) % DIRECTIONS) for one in (0, 1))
        known = ((tubes.counts >= _FEWEST_POINTS) & ~tubes.fixed())[..., None]
        agreed = torch.where(known, (1.0 - share) * near + share * far, 0.0).sum(dim=1)
        return agreed / known.sum(dim=1).clamp_min(1)


def _heaps(flat: torch.Tensor, slot: torch.Tensor, counts: torch.Tensor) -> torch.Tensor:
    """(S, DIRECTIONS): share of pairs of a slot's points that fall into one bin, by direction.

    Args:
        flat: (Q, 2) metres about the slots' centres.
        slot: (Q,) int64, 0..S-1.
        counts: (S,) of points in each.
    """
    chosen = some_of_each(slot, counts, _MOST_POINTS)
    flat, slot = flat[chosen], slot[chosen]
    angle = torch.arange(DIRECTIONS, device=flat.device) * (math.pi / DIRECTIONS)
    across = flat @ torch.stack([torch.cos(angle), torch.sin(angle)]) / BIN_M + _BINS / 2
    ways = torch.arange(DIRECTIONS, device=flat.device)
    base = (slot[:, None] * DIRECTIONS + ways) * _BINS
    pairs = flat.new_zeros(len(counts), DIRECTIONS)
    for aside in (0.0, 0.5):  # no bin's edge is another's better
        bins = (across + aside).floor().long().clamp_(0, _BINS - 1)
        heap = torch.bincount((base + bins).flatten(), minlength=pairs.numel() * _BINS)
        heap = heap.view(*pairs.shape, _BINS).float()
        pairs = pairs + (heap * (heap - 1.0)).sum(dim=2)
    used = torch.bincount(slot, minlength=len(counts)).float()
    return pairs / (2.0 * used * (used - 1.0)).clamp_min(1.0)[:, None]
