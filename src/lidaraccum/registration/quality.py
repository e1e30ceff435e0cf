"""Whether a registration can be trusted, and if not, why, in words."""

from __future__ import annotations

from lidaraccum.data.registered import RegistrationQuality
from lidaraccum.registration.locate import Located
from lidaraccum.registration.settings import RegistrationSettings

TRUSTED_SHARE = 0.85
"""A score this near to the usual one needs no rival."""

DOUBTED_SHARE = 0.6
"""A score this far below the usual one is doubtful."""

MEMORY = 0.9
"""How slowly the usual score follows."""


class Judge:
    """Knows how well frames of this sequence usually fit."""

    def __init__(self, settings: RegistrationSettings) -> None:
        self._settings = settings
        self._usual: float | None = None

    def trusts(self, located: Located) -> bool:
        """Whether this answer is good enough to look for no other."""
        alignment = located.alignment
        if self._usual is None or alignment.overlap < self._settings.min_overlap:
            return False
        return alignment.score >= TRUSTED_SHARE * self._usual

    def judge(self, located: Located) -> RegistrationQuality:
        """Put the answer's worth into words, and learn from it."""
        alignment = located.alignment
        doubts = []
        if alignment.overlap < self._settings.min_overlap:
            doubts.append(f"only {alignment.overlap:.0%} of the points fit the map")
        elif self._usual is not None and alignment.score < DOUBTED_SHARE * self._usual:
            share = alignment.score / self._usual
            doubts.append(f"it fits the map only {share:.0%} as well as the frames before")
        if located.rival > 1 - self._settings.ambiguity:
            doubts.append(
                f"another motion, {located.rival_distance_m:.1f} m away, fits nearly as well"
            )
        if not doubts:
            usual = alignment.score if self._usual is None else self._usual
            self._usual = MEMORY * usual + (1 - MEMORY) * alignment.score
        return RegistrationQuality(
            located.hypothesis, alignment.overlap, alignment.residual_m, tuple(doubts)
        )
