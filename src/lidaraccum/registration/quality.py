"""Whether a registration can be trusted, and if not, why, in words."""

from __future__ import annotations

import numpy as np

from lidaraccum.data.registered import RegistrationQuality
from lidaraccum.registration.icp import Alignment
from lidaraccum.registration.locate import Located
from lidaraccum.registration.settings import RegistrationSettings

TRUSTED_SHARE = 0.85
"""A score this near to the usual one needs no rival."""

DOUBTED_SHARE = 0.7
"""A score this far below the usual one is doubtful."""

LOST_SHARE = 0.5
"""Below this the frame does not lie on the map at all."""

MEMORY_OF_WORSE, MEMORY_OF_BETTER = 0.9, 0.5
"""How slowly the usual score follows; quickly upwards, as the map fills."""

MIN_HOLD = 0.003
"""Information per point that a direction needs to be fixed: what three planes in a thousand that
face it give. Beside a street's walls it is 0.05-0.3."""


ADRIFT = "nothing in view fixes the motion in one direction"


class Judge:
    """Knows how well frames of this sequence usually fit.

    Attributes:
        first: Score of the first frame judged, if there was no doubt about it; else None.
    """

    def __init__(self, settings: RegistrationSettings, hoped: float | None = None) -> None:
        """Begin with nothing judged; ``hoped``: the score that the first frame is able to reach."""
        self._settings = settings
        self._hoped = hoped
        self._usual: float | None = None
        self.first: float | None = None

    def forget(self) -> None:
        """Begin anew: the map did."""
        self._usual = self._hoped = None

    def trusts(self, located: Located) -> bool:
        """Whether this answer is good enough to look for no other."""
        alignment = located.alignment
        usual = self._hoped if self._usual is None else self._usual
        if usual is None or alignment.overlap < self._settings.min_overlap:
            return False
        return alignment.score >= TRUSTED_SHARE * usual

    def is_lost(self, located: Located, *, is_smooth: bool) -> bool:
        """Whether the best answer is none: it hardly fits, or fits badly and far from expected."""
        if self._usual is None:
            return False
        needed = LOST_SHARE if is_smooth else DOUBTED_SHARE
        return located.alignment.score < needed * self._usual

    def judge(self, located: Located, speed_mps: float) -> RegistrationQuality:
        """Put the answer's worth into words, and learn from it."""
        alignment = located.alignment
        doubts = self._doubts(located, speed_mps)
        if self._usual is None and not doubts:
            self.first = alignment.score
        if not doubts or self._usual is None:
            usual = alignment.score if self._usual is None else self._usual
            memory = MEMORY_OF_BETTER if alignment.score > usual else MEMORY_OF_WORSE
            self._usual = memory * usual + (1 - memory) * alignment.score
        return RegistrationQuality(
            located.hypothesis, alignment.overlap, alignment.residual_m, tuple(doubts)
        )

    def _doubts(self, located: Located, speed_mps: float) -> list[str]:
        alignment, doubts = located.alignment, []
        if alignment.overlap < self._settings.min_overlap:
            doubts.append(f"only {alignment.overlap:.0%} of the points fit the map")
        elif self._usual is not None and alignment.score < DOUBTED_SHARE * self._usual:
            share = alignment.score / self._usual
            doubts.append(f"it fits the map only {share:.0%} as well as the frames before")
        if located.rival > 1 - self._settings.ambiguity:
            distance = located.rival_distance_m
            doubts.append(f"another motion, {distance:.1f} m away, fits nearly as well")
        if weakest_direction(alignment) < MIN_HOLD and not located.sighted:
            doubts.append(ADRIFT)
        if speed_mps > self._settings.max_speed_mps:
            doubts.append(f"it implies {speed_mps:.0f} m/s")
        return doubts


def weakest_direction(alignment: Alignment) -> float:
    """Information per point about the least known direction of translation, rotation unknown."""
    rotation, cross = alignment.information[:3, :3], alignment.information[:3, 3:]
    left = alignment.information[3:, 3:] - cross.T @ np.linalg.solve(
        rotation + 1e-9 * np.eye(3), cross
    )
    return float(np.linalg.eigvalsh(left)[0])
