"""Compares training recipes: each trained with each seed on one budget, scored, put into a table.

Usage: compare_recipes.py RECIPES.toml -o FOLDER [--drive DIR]... [--part K/N] [--dry-run]

FOLDER gets table.md and table.json, written anew after each run, and NAME/seed-N of each run. What
is done is not done again: stopped or killed, the same command goes on. scripts/recipes.toml is an
example of RECIPES.toml and says what may stand in it. Where the file has factors instead of
recipes (scripts/screening.toml), each run sets about half of them, and effects.md and effects.json
tell what each does.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from lidaraccum.cli.door import INTERRUPTED, Command
from lidaraccum.cli.options import read_toml
from lidaraccum.cli.tables import merged, settings_from
from lidaraccum.cli.train_talk import Interrupts
from lidaraccum.errors import SettingsError
from lidaraccum.evaluation.recipe_table import (
    effect_data,
    effect_tables,
    recipe_data,
    recipe_tables,
)
from lidaraccum.io.atomic import write_json, write_text
from lidaraccum.training.comparison import RunResult, compare
from lidaraccum.training.recipes import PlanSettings, Recipe, check_plan
from lidaraccum.training.screening import Factor, Screening
from lidaraccum.training.settings import TrainSettings
from lidaraccum.training.watch import Watch

BASE, RECIPE, SET, FACTOR = "base", "recipe", "set", "factor"
FOR_ALL = ("seed", "steps", "hours")
"""Settings that the comparison decides for all of its runs."""


@dataclass(frozen=True)
class _Named:
    """What a [[recipe]] or [[factor]] table says beside what it sets."""

    name: str = ""


class Part(click.ParamType):
    """K/N, every N-th of a list from the K-th on, as a slice."""

    name = "part"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> slice:
        """The slice."""
        told = re.fullmatch(r"([1-9]\d*)/([1-9]\d*)", value)
        if told is None or int(told[1]) > int(told[2]):
            self.fail(f"{value!r} is no part: 1/2 and 2/2 are", param, ctx)
        return slice(int(told[1]) - 1, None, int(told[2]))


@click.command(cls=Command)
@click.argument("recipes", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path, file_okay=False), required=True)
@click.option(
    "--drive",
    "drives",
    type=click.Path(path_type=Path, exists=True, file_okay=False, resolve_path=True),
    multiple=True,
    help="Score on this labelled recording, too.",
)
@click.option(
    "--part",
    type=Part(),
    default="1/1",
    metavar="K/N",
    help="Do only every N-th recipe from the K-th on; N such commands share one folder, and one "
    "without --part then makes the tables of all.",
)
@click.option("--dry-run", is_flag=True, help="Say what would be run, do nothing.")
@click.option("-v", "--verbose", is_flag=True, help="Say what is being done.")
def main(recipes: Path, output: Path, drives: tuple[Path, ...], part: slice, **params: Any) -> None:
    """Train each recipe with each seed on one budget, score it, and leave a table."""
    plan, listed, screening = read_plan(read_toml(recipes), recipes.name)
    plan = replace(plan, exam=replace(plan.exam, drives=(*plan.exam.drives, *drives)))
    listed = listed[part]
    if params["dry_run"]:
        tell_plan(plan, listed)
        return
    names, done = [recipe.name for recipe in listed], list[RunResult]()
    with Interrupts() as interrupts:
        for result in compare(plan, listed, output, Watch(wants_end=lambda: interrupts.came)):
            done.append(result)
            click.echo(f"{len(done)} of {len(listed) * len(plan.seeds)}: {told(result)}", err=True)
            if part.step == 1:
                leave(output, names, done, screening)
    if interrupts.came:
        click.get_current_context().exit(INTERRUPTED)


def read_plan(
    file: Mapping[str, Any], name: str
) -> tuple[PlanSettings, list[Recipe], Screening | None]:
    """What the file says: what all recipes have alike, the recipes in order, their design if any.

    Raises:
        SettingsError: It says what it may not, or what cannot be run.
    """
    plan = settings_from(PlanSettings, _without(file, BASE, RECIPE, FACTOR), name)
    base = _settings_table(file.get(BASE, {}), BASE)
    tables, asked = file.get(RECIPE, []), file.get(FACTOR, [])
    if not all(isinstance(one, list) for one in (tables, asked)) or bool(tables) == bool(asked):
        hint = f"each is a [[{RECIPE}]], or a [[{FACTOR}]], table"
        raise SettingsError(f"{name} has either recipes or factors", hint=hint)
    screening = None
    if asked:
        factors = [_factor(table) for table in asked]
        screening = Screening.of([factor.name for factor in factors])
        recipes = _screened(base, factors, screening)
    else:
        recipes = [_recipe(base, table) for table in tables]
    check_plan(plan, recipes)
    return plan, recipes, screening


def _recipe(base: Mapping[str, Any], table: Mapping[str, Any]) -> Recipe:
    name = settings_from(_Named, _without(table, SET), RECIPE).name
    mine = merged(base, _settings_table(table.get(SET, {}), f"{name}.{SET}"))
    return _recipe_of(name, mine)


def _recipe_of(name: str, table: Mapping[str, Any]) -> Recipe:
    # The budget is the plan's: this one is never run.
    return Recipe(name, settings_from(TrainSettings, {**table, "steps": 1}, name))


def _factor(table: Mapping[str, Any]) -> Factor:
    name = settings_from(_Named, _without(table, "low", "high"), FACTOR).name
    low, high = (_settings_table(table.get(side, {}), f"{name}.{side}") for side in ("low", "high"))
    if not name or low == high:
        raise SettingsError(f"factor {name!r} wants a name, and another setting low than high")
    return Factor(name, low, high)


def _without(table: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key not in keys}


def _screened(
    base: Mapping[str, Any], factors: Sequence[Factor], screening: Screening
) -> list[Recipe]:
    recipes = []
    for name, row in zip(screening.runs, screening.high, strict=True):
        table = dict(base)
        for factor, high in zip(factors, row, strict=False):
            table = merged(table, factor.high if high else factor.low)
        recipes.append(_recipe_of(name, table))
    return recipes


def _settings_table(table: Any, name: str) -> Mapping[str, Any]:
    if not isinstance(table, Mapping):
        raise SettingsError(f"{name} is a table, not {table!r}")
    for key in FOR_ALL:
        if key in table:
            hint = "seeds, minutes and windows stand before all tables"
            raise SettingsError(f"[{name}] sets {key!r}, which all recipes have alike", hint=hint)
    return table


def tell_plan(plan: PlanSettings, recipes: list[Recipe]) -> None:
    """What would be run."""
    runs = len(recipes) * len(plan.seeds)
    budget = f"{plan.minutes:g} minutes" if plan.windows is None else f"{plan.windows} windows"
    click.echo(f"{len(recipes)} recipes, {len(plan.seeds)} seeds: {runs} runs of {budget} each.")
    for recipe in recipes:
        click.echo(recipe.name)


def told(result: RunResult) -> str:
    """A run in one line."""
    rate = result.windows / result.seconds
    return f"{result.recipe} seed {result.seed}: {result.windows} windows, {rate:.2f} a second"


def leave(
    folder: Path, names: list[str], done: list[RunResult], screening: Screening | None
) -> None:
    """Write the tables of what is done so far."""
    write_text(folder / "table.md", recipe_tables(names, done), overwrite=True)
    write_json(folder / "table.json", recipe_data(names, done), overwrite=True)
    if screening is not None:
        write_text(folder / "effects.md", effect_tables(screening, done), overwrite=True)
        write_json(folder / "effects.json", effect_data(screening, done), overwrite=True)


if __name__ == "__main__":
    main()
