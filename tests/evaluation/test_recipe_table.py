"""Recipes beside each other, over seeds."""

from __future__ import annotations

from dataclasses import fields, replace
from math import nan

import pytest

from lidaraccum.evaluation.recipe_table import Spread, recipe_data, recipe_tables
from lidaraccum.training.comparison import MeanLosses, RunResult
from lidaraccum.training.exam import Marks
from lidaraccum.training.scores import Scores

NOTHING = Scores(**{one.name: nan for one in fields(Scores)})
RUN = RunResult(
    "base", 0, 100, 50.0, MeanLosses(1.0, 2.0, 3.0, 4.0, 5.0), Marks(NOTHING, {"street": NOTHING})
)


def scored(seed: int, motion_iou: float) -> RunResult:
    scores = replace(NOTHING, motion_iou=motion_iou)
    return replace(RUN, seed=seed, marks=Marks(scores, {"street": scores}))


def cells(table: str, part: str, recipe: str) -> dict[str, str]:
    """The row of a recipe in one of the tables, by its titles."""
    lines = table.split(f"### {part}\n")[1].split("###")[0].strip().splitlines()
    titles, _, *rows = ([cell.strip() for cell in line.split("|")[1:-1]] for line in lines)
    return next(dict(zip(titles, row, strict=True)) for row in rows if row[0] == recipe)


def test_a_spread_passes_over_what_has_no_value() -> None:
    assert Spread.of([3.0, nan, 1.0]) == Spread(2.0, 1.0, 3.0)
    assert str(Spread.of([nan])) == str(Spread.of([])) == str(Spread(nan, nan, nan))


def test_a_row_tells_the_mean_and_between_what_the_seeds_lie() -> None:
    runs = [scored(0, 0.5), scored(4, 0.7), scored(5, nan)]
    table = recipe_tables(["base", "other"], runs)
    for part in ("Simulated test set", "street"):
        row = cells(table, part, "base")
        assert row["motion IoU %, poses true"] == "60.0 (50.0..70.0)"
        assert row["foreground IoU %"] == "-"
        assert row["seeds"] == "3"
    (data, _) = recipe_data(["base", "other"], runs)
    assert data["seeds"] == [0, 4, 5]
    assert data["street"]["motion_iou"] == pytest.approx({"mean": 0.6, "least": 0.5, "most": 0.7})


def test_what_all_seeds_agree_on_has_no_spread() -> None:
    row = cells(recipe_tables(["base"], [RUN, replace(RUN, seed=1)]), "Learned", "base")
    assert (row["windows"], row["windows/s"], row["objects"]) == ("100", "2.00", "5.00")


def test_a_recipe_that_is_not_done_yet_has_its_row() -> None:
    row = cells(recipe_tables(["base", "other"], [RUN]), "Learned", "other")
    assert row["seeds"] == "0"
    assert row["windows"] == row["ego"] == "-"
