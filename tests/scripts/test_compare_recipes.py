"""Recipes compared, through the user's door: refused, run, killed, gone on with."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import torch
from click.testing import CliRunner, Result

from lidaraccum.cli.options import read_toml
from lidaraccum.cli.tables import settings_from
from lidaraccum.errors import SettingsError
from lidaraccum.training.settings import TrainSettings

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "scripts" / "compare_recipes.py"
STREET = ROOT / "examples" / "street"

PLAN = """
seeds = [0, 1]
windows = 2
drives = "DRIVES"

[exam]
windows = 0
extent_m = 16.0
drive_windows = 1

[base]
keep_drives = 1
workers = 0
threads = 1
validate_steps = 0
checkpoint_minutes = 0.0
log_steps = 1
device = "cpu"

[base.network]
base_widths = [8, 16]
motion_widths = [16, 16]
ego_pillars = 64
temporal_channels = 8
temporal_blocks = 1
point_channels = 16
tube_channels = 16

[base.windows]
extent_m = 16.0
lengths = [2]
windows_per_drive = 1
drive_frames = 2
sensors = ["VLP-16"]

[base.optimiser]
batch = 1

[[recipe]]
name = "base"

[[recipe]]
name = "fast"
set.optimiser.rate = 1e-3
"""


FACTORS = """[[factor]]
name = "fast"
high.optimiser.rate = 1e-3
low.optimiser.rate = 1e-4

[[factor]]
name = "steep"
high.optimiser.decay = 0.5
"""


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location(SCRIPT.stem, SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[SCRIPT.stem] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("kept")


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def written(folder: Path, drives: Path, *changes: tuple[str, str]) -> Path:
    """The plan as a file, with some of its text replaced."""
    text = PLAN.replace("DRIVES", str(drives))
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "plan.toml"
    path.write_text(text)
    return path


def run(script: ModuleType, *args: object) -> Result:
    return CliRunner().invoke(script.main, [str(arg) for arg in args])


def read(path: Path) -> Any:
    return json.loads(path.read_text())


def steps(folder: Path) -> list[int]:
    path = folder / "metrics.jsonl"
    lines = path.read_text().splitlines(keepends=True) if path.exists() else []
    return [json.loads(line)["step"] for line in lines if line.endswith("\n")]


@pytest.mark.slow
def test_a_table_tells_the_mean_and_the_spread_of_the_runs(
    script: ModuleType, drives: Path, tmp_path: Path
) -> None:
    plan, out = written(tmp_path, drives), tmp_path / "out"
    result = run(script, plan, "-o", out, "--drive", STREET)
    assert result.exit_code == 0, result.stderr
    rows = read(out / "table.json")
    assert [row["recipe"] for row in rows] == ["base", "fast"]
    for row in rows:
        assert row["seeds"] == [0, 1]
        runs = [read(out / row["recipe"] / f"seed-{seed}" / "result.json") for seed in (0, 1)]
        assert row["learned"]["windows"] == {"mean": 2.0, "least": 2, "most": 2}
        ego = [one["losses"]["ego"] for one in runs]
        assert row["learned"]["ego"]["mean"] == pytest.approx(sum(ego) / 2)
        assert (row["learned"]["ego"]["least"], row["learned"]["ego"]["most"]) == (
            min(ego), max(ego),
        )  # fmt: skip
        assert ego[0] != ego[1]
        assert row["simulated"]["foreground_iou"]["mean"] is None  # no window was asked for
        assert 0 <= row["street"]["foreground_iou"]["mean"] <= 1
    lines = (out / "table.md").read_text().splitlines()
    assert [line.split(" | ")[0] for line in lines].count("| fast") == 3
    assert len(list(drives.rglob("*.npz"))) == 1

    # Scored on something else: what is learned stays.
    weights = (out / "base" / "seed-0" / "weights.safetensors").read_bytes()
    again = run(script, plan, "-o", out)
    assert again.exit_code == 0, again.stderr
    assert "street" not in read(out / "table.json")[0]
    assert (out / "base" / "seed-0" / "weights.safetensors").read_bytes() == weights
    assert [steps(path.parent) for path in out.rglob("result.json")] == [[1, 2]] * 4


def test_drives_that_hold_something_else_lie_apart(
    script: ModuleType, drives: Path, tmp_path: Path
) -> None:
    other = 'set.windows.sensors = ["HDL-32E"]'
    plan = written(
        tmp_path, drives, ("set.optimiser.rate = 1e-3", other), ("seeds = [0, 1]", "seeds = [3]")
    )
    result = run(script, plan, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    folders = {path.parent.name for path in drives.rglob("*.npz")}
    assert folders == {"16m-2frames-VLP-16", "16m-2frames-HDL-32E"}


@pytest.mark.slow
def test_a_killed_comparison_goes_on(script: ModuleType, drives: Path, tmp_path: Path) -> None:
    enough = ("windows = 2\n", "windows = 10\n")
    plan = written(tmp_path, drives, enough, ("seeds = [0, 1]", "seeds = [0]"))
    out = tmp_path / "out"
    first, second = out / "base" / "seed-0", out / "fast" / "seed-0"
    life = subprocess.Popen([sys.executable, str(SCRIPT), str(plan), "-o", str(out)])
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and life.poll() is None and len(steps(second)) < 2:
        time.sleep(0.01)
    life.kill()
    assert life.wait() == -9
    assert (first / "result.json").exists()
    assert not (second / "result.json").exists()
    assert [row["seeds"] for row in read(out / "table.json")] == [[0], []]
    done = {path: path.stat().st_mtime_ns for path in first.iterdir()}

    result = run(script, plan, "-o", out, "-v")
    assert result.exit_code == 0, result.stderr
    assert "resumed at step" in result.stderr
    assert {path: path.stat().st_mtime_ns for path in first.iterdir()} == done
    assert steps(second) == list(range(1, 11))
    assert [row["seeds"] for row in read(out / "table.json")] == [[0], [0]]


def test_a_folder_is_not_gone_on_with_as_something_else(
    script: ModuleType, drives: Path, tmp_path: Path
) -> None:
    one = ("seeds = [0, 1]", "seeds = [0]")
    out = tmp_path / "out"
    assert run(script, written(tmp_path, drives, one), "-o", out).exit_code == 0
    for change in (("1e-3", "2e-3"), ("windows = 2\n", "windows = 1\n")):
        refused = run(script, written(tmp_path, drives, one, change), "-o", out)
        assert refused.exit_code == 2
        assert "other settings" in refused.stderr


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("rate = 1e-3", "rat = 1e-3", "did you mean 'rate'"),
        ("rate = 1e-3", 'rate = "fast"', "fast.optimiser.rate is a number"),
        ("[base]", "[base]\nepochs = 2", "'epochs', which is no setting"),
        ("[base]", "[base]\nseed = 2", "'seed', which all recipes have alike"),
        ("set.optimiser.rate", "set.steps", "'steps', which all recipes have alike"),
        ('name = "fast"', 'nam = "fast"', "did you mean 'name'"),
        ('name = "fast"', 'name = "base"', "two recipes have one name"),
        ('name = "fast"', 'name = "../fast"', "no name for a recipe"),
        ('["VLP-16"]', '["VLP-61"]', "no sensor is called 'VLP-61'"),
        ("seeds", "sedes", "did you mean 'seeds'"),
        ("windows = 2\n", "", "either minutes or windows"),
        ("windows = 2\n", "windows = 0\n", "more than nothing"),
        ('drives = "', 'minutes = 1.0\ndrives = "', "either minutes or windows"),
        ('drives = "', '# drives = "', "drives names a folder"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_runs(
    script: ModuleType, drives: Path, tmp_path: Path, old: str, new: str, told: str
) -> None:
    assert_refused(script, written(tmp_path, drives, (old, new)), told)


def assert_refused(script: ModuleType, plan: Path, told: str) -> None:
    out = plan.parent / "out"
    refused = run(script, plan, "-o", out)
    assert refused.exit_code == 2
    assert told in refused.stderr
    assert not out.exists()


def test_parts_do_every_recipe_once(script: ModuleType, drives: Path, tmp_path: Path) -> None:
    plan = written(tmp_path, drives)
    listed = []
    for part in ("1/2", "2/2"):
        told = run(script, plan, "-o", tmp_path / "out", "--part", part, "--dry-run")
        assert told.exit_code == 0, told.stderr
        listed += told.stdout.splitlines()[1:]
    assert listed == ["base", "fast"]
    for wrong in ("3/2", "0/2", "half"):
        refused = run(script, plan, "-o", tmp_path / "out", "--part", wrong)
        assert refused.exit_code == 2
        assert "is no part" in refused.stderr


def test_the_example_holds_recipes_that_differ(script: ModuleType) -> None:
    plan, recipes, _ = script.read_plan(read_toml(ROOT / "scripts" / "recipes.toml"), "it")
    settings = [plan.settings_for(recipe, plan.seeds[0]) for recipe in recipes]
    alike = [
        (mine.name, its.name)
        for place, mine in enumerate(recipes)
        for other, its in enumerate(recipes[:place])
        if settings[place] == settings[other]
    ]
    assert alike == []


def test_the_recipe_is_one_that_train_takes() -> None:
    table = read_toml(ROOT / "scripts" / "recipe.toml")["train"]
    assert settings_from(TrainSettings, {**table, "steps": 1}, "train").keep_drives > 0


def test_every_recipe_has_the_same_budget(script: ModuleType, drives: Path, tmp_path: Path) -> None:
    fours = ("set.optimiser.rate = 1e-3", "set.optimiser.batch = 4")
    ten = ("windows = 2\n", "windows = 10\n")
    plan, recipes, _ = script.read_plan(read_toml(written(tmp_path, drives, fours, ten)), "plan")
    assert [plan.settings_for(recipe, 0).steps for recipe in recipes] == [10, 3]
    clock = ("windows = 2\n", "minutes = 90\n")
    plan, recipes, _ = script.read_plan(read_toml(written(tmp_path, drives, fours, clock)), "plan")
    for recipe in recipes:
        settings = plan.settings_for(recipe, 7)
        assert (settings.hours, settings.steps, settings.seed) == (1.5, None, 7)


def test_a_plan_without_recipes_is_refused(script: ModuleType) -> None:
    with pytest.raises(SettingsError, match="either recipes or factors"):
        script.read_plan({"windows": 1}, "empty.toml")


def screened(folder: Path, drives: Path, *changes: tuple[str, str]) -> Path:
    """The plan with factors in the recipes' stead."""
    recipes = PLAN[PLAN.index("[[recipe]]") :]
    factors = FACTORS
    for old, new in changes:
        assert old in factors
        factors = factors.replace(old, new)
    return written(folder, drives, (recipes, factors), ("seeds = [0, 1]", "seeds = [0]"))


def test_half_of_the_runs_set_a_factor(script: ModuleType, drives: Path, tmp_path: Path) -> None:
    plan, recipes, screening = script.read_plan(read_toml(screened(tmp_path, drives)), "it")
    assert [recipe.name for recipe in recipes] == list(screening.runs)
    settings = [plan.settings_for(recipe, 0) for recipe in recipes]
    rates = [one.optimiser.rate for one in settings]
    assert rates == [1e-3 if high else 1e-4 for high in screening.high[:, 0]]
    decays = [one.optimiser.decay for one in settings]
    assert decays == [0.5 if high else 0.98 for high in screening.high[:, 1]]
    assert rates.count(1e-3) == decays.count(0.5) == len(recipes) // 2


@pytest.mark.slow
def test_effects_are_told_once_all_has_been_run(
    script: ModuleType, drives: Path, tmp_path: Path
) -> None:
    plan, out = screened(tmp_path, drives), tmp_path / "out"
    result = run(script, plan, "-o", out)
    assert result.exit_code == 0, result.stderr
    _, recipes, screening = script.read_plan(read_toml(plan), "it")
    ego = {row["recipe"]: row["learned"]["ego"]["mean"] for row in read(out / "table.json")}
    fast = [ego[name] for name, high in zip(screening.runs, screening.high, strict=True) if high[0]]
    slow = [value for value in ego.values() if value not in fast]
    told = read(out / "effects.json")["learned"]["ego"]
    assert len(fast) == len(slow) == len(recipes) // 2
    expected = sum(fast) / len(fast) - sum(slow) / len(slow)
    assert told["factors"]["fast"] == pytest.approx(expected)
    assert told["chance"] >= 0  # two values only: the rate's alone differ in so few steps
    lines = (out / "effects.md").read_text().splitlines()
    for name in ("fast", "steep", "chance, one sigma"):
        assert sum(line.startswith(f"| {name} |") for line in lines) == 2


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("rate = 1e-3", "rat = 1e-3", "did you mean 'rate'"),
        ("high.optimiser.decay", "hi.optimiser.decay", "'hi', which is no setting"),
        ("high.optimiser.decay = 0.5", "", "another setting low than high"),
        ("high.optimiser.decay", "high.steps", "'steps', which all recipes have alike"),
        ('"steep"', '"fast"', "two factors have one name"),
        ("[[factor]]", "[[recipe]]\nname = 'a'\n[[factor]]", "either recipes or factors"),
    ],
)
def test_factors_that_make_no_sense_are_refused(
    script: ModuleType, drives: Path, tmp_path: Path, old: str, new: str, told: str
) -> None:
    assert_refused(script, screened(tmp_path, drives, (old, new)), told)


@pytest.mark.parametrize("name", ["screening", "screening_more"])
def test_the_examples_screen_what_they_say(script: ModuleType, name: str) -> None:
    plan, recipes, screening = script.read_plan(read_toml(ROOT / "scripts" / f"{name}.toml"), "it")
    settings = {repr(plan.settings_for(recipe, 0)) for recipe in recipes}
    assert len(settings) == len(recipes) == len(screening.runs)
