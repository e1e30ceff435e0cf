"""What is compared: recipes, and what all of them have alike."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from lidaraccum.errors import SettingsError
from lidaraccum.training.exam import ExamSettings
from lidaraccum.training.settings import TrainSettings

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class Recipe:
    """Settings with a name; seed and budget are the comparison's."""

    name: str
    settings: TrainSettings

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise SettingsError(
                f"{self.name!r} is no name for a recipe",
                hint="letters, digits, dots, - and _, for a folder is called so",
            )


@dataclass(frozen=True)
class PlanSettings:
    """What all recipes of a comparison have alike.

    Attributes:
        seeds: Each recipe is trained with each.
        minutes: A run lasts so long; or
        windows: it learns so many windows. One of the two is given.
        drives: Folder for drives that are kept, for all recipes that keep any.
        exam: What the weights are scored on.
    """

    seeds: tuple[int, ...] = (0,)
    minutes: float | None = None
    windows: int | None = None
    drives: Path | None = None
    exam: ExamSettings = field(default_factory=ExamSettings)

    def __post_init__(self) -> None:
        if not self.seeds or len(set(self.seeds)) < len(self.seeds):
            raise SettingsError("a comparison has one seed or more, each once")
        if (self.minutes is None) == (self.windows is None):
            raise SettingsError("a run's budget is either minutes or windows")
        if min(value for value in (self.minutes, self.windows) if value is not None) <= 0:
            raise SettingsError("a run's budget is more than nothing")

    def settings_for(self, recipe: Recipe, seed: int) -> TrainSettings:
        """A recipe with its seed and its budget."""
        if self.windows is None:
            assert self.minutes is not None, "checked at birth"
            return replace(recipe.settings, seed=seed, steps=None, hours=self.minutes / 60)
        steps = math.ceil(self.windows / recipe.settings.optimiser.batch)
        return replace(recipe.settings, seed=seed, steps=steps, hours=None)


def check_plan(plan: PlanSettings, recipes: Sequence[Recipe]) -> None:
    """Refuse what could not be run to its end.

    Raises:
        SettingsError: Two recipes share a name, or there is no folder for kept drives.
    """
    if len({recipe.name for recipe in recipes}) < len(recipes):
        raise SettingsError("two recipes have one name")
    if plan.drives is None and any(recipe.settings.keep_drives for recipe in recipes):
        raise SettingsError("a recipe keeps drives", hint="drives names a folder for them")
