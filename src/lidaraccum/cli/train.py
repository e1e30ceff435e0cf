"""`lidaraccum train`: weights from simulated drives, or from labelled ones."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lidaraccum.cli import options
from lidaraccum.cli.door import INTERRUPTED, Command
from lidaraccum.cli.tables import merged, settings_from, toml_of
from lidaraccum.errors import OutputExistsError, SettingsError

if TYPE_CHECKING:
    from lidaraccum.training.settings import TrainSettings
    from lidaraccum.training.trainer import TrainReport

SETTINGS_FILE = "train.toml"
TABLE = "train"
_BUDGETS = ("steps", "hours")


@click.command(cls=Command)
@click.argument("data", nargs=-1, metavar="[DATA]...")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="The run's folder: weights, state, metrics, curves.",
)
@click.option("--resume", is_flag=True, help="Go on with the run in the folder, as it was set.")
@click.option("--steps", type=click.IntRange(min=1), help="End after so many steps, all together.")
@click.option(
    "--hours", type=click.FloatRange(min=0), help="End after so long, resumptions counted in."
)
@click.option(
    "--weights",
    "start_from",
    allow_from_autoenv=False,
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="Start from these weights (fine-tuning); from nothing without.",
)
@click.option("--device", type=click.Choice(["auto", "cpu", "cuda"]), help="auto without.")
@click.option(
    "--workers", type=click.IntRange(min=0), help="Processes that make windows; 1 without."
)
@click.option("--seed", type=click.IntRange(min=0), help="Of all that is drawn; 0 without.")
@click.option(
    "--extent", type=float, metavar="M", help="Side of the grid windows are cut to; 32 without."
)
@click.option("--batch", type=click.IntRange(min=1), help="Windows a step; 2 without.")
@click.option("--dry-run", is_flag=True, help="Show all settings as TOML, do nothing.")
@options.talk_options
def train(**params: Any) -> None:
    """Train the network on simulated drives, or on DATA: labelled sequences, folders of them.

    Interrupted or killed, a run goes on with --resume. All other settings stand in a [train] table
    of the --config file; --dry-run shows them.
    """
    from lidaraccum.cli.train_data import sources_of

    folder = params["output"]
    settings, data = planned(params)
    if params["dry_run"]:
        click.echo(written(settings, data))
        return
    check_unused(folder, resume=params["resume"])
    sources = sources_of(data, settings)
    report, interrupted = go(settings, params, sources, written(settings, data))
    if interrupted:
        click.echo(f"Interrupted at step {report.steps}; --resume goes on from there.", err=True)
        click.get_current_context().exit(INTERRUPTED)
    tell(report, params)


def planned(params: Mapping[str, Any]) -> tuple[TrainSettings, list[str]]:
    """Settings and data of the run: flags over the file's [train], over those it began with."""
    from lidaraccum.training.settings import TrainSettings

    table: dict[str, Any] = {}
    began_with = params["output"] / SETTINGS_FILE
    if params["resume"] and began_with.is_file():
        table = options.read_toml(began_with).get(TABLE, {})
    for layer in (options.table_of(click.get_current_context(), TABLE), flags(params)):
        if any(name in layer for name in _BUDGETS):
            table = {name: value for name, value in table.items() if name not in _BUDGETS}
        table = merged(table, layer)
    data = table.pop("data", [])
    if not isinstance(data, (list, tuple)) or not all(isinstance(one, str) for one in data):
        raise SettingsError(f"{TABLE}.data is a list of folders, not {data!r}")
    return settings_from(TrainSettings, table, TABLE), list(data)


def flags(params: Mapping[str, Any]) -> dict[str, Any]:
    """What the options say, as a [train] table."""
    start = params["start_from"]
    said = {
        "steps": params["steps"],
        "hours": params["hours"],
        "seed": params["seed"],
        "device": params["device"],
        "workers": params["workers"],
        "start_from": start and str(start.resolve()),
        "data": [str(Path(one).resolve()) for one in params["data"]] or None,
    }
    table: dict[str, Any] = {name: value for name, value in said.items() if value is not None}
    if params["extent"] is not None:
        table["windows"] = {"extent_m": params["extent"]}
    if params["batch"] is not None:
        table["optimiser"] = {"batch": params["batch"]}
    return table


def written(settings: TrainSettings, data: list[str]) -> str:
    """All that `--config` takes, to do the same again."""
    head, rest = toml_of(settings, TABLE).split("\n", 1)
    return f"{head}\ndata = {json.dumps(data)}\n{rest}"


def check_unused(folder: Path, *, resume: bool) -> None:
    """Refuse a folder that holds a run, unless it is to go on.

    Raises:
        OutputExistsError: It does.
    """
    from lidaraccum.training.state import STATE_FILE

    if (folder / STATE_FILE).exists() and not resume:
        raise OutputExistsError(f"{folder} already holds a run", hint="--resume goes on with it")


def go(
    settings: TrainSettings, params: Mapping[str, Any], sources: Any, again: str
) -> tuple[TrainReport, bool]:
    """Train; whether it was interrupted is told beside what it came to."""
    from lidaraccum.cli.train_talk import Interrupts, TrainTalk
    from lidaraccum.io.atomic import write_text
    from lidaraccum.training.trainer import train as train_network
    from lidaraccum.training.watch import Watch

    folder = params["output"]

    def remember() -> None:
        write_text(folder / SETTINGS_FILE, f"{again}\n", overwrite=True)

    manners = {"quiet": params["quiet"], "bar": not params["no_progress"]}
    with Interrupts() as interrupts, TrainTalk(settings, folder, on_first=remember, **manners) as t:
        report = train_network(
            settings,
            folder,
            resume=params["resume"],
            source=sources.learned,
            held_out=sources.held_out,
            watch=Watch(t.step, t.scores, lambda: interrupts.came),
        )
        t.draw()
    return report, interrupts.came


def tell(report: TrainReport, params: Mapping[str, Any]) -> None:
    """What the run came to."""
    from lidaraccum.io.atomic import json_text

    if params["as_json"]:
        scores = None if report.scores is None else asdict(report.scores)
        summary = {"steps": report.steps, "seconds": report.seconds, "scores": scores}
        click.echo(json_text({**summary, "weights": str(report.weights)}), nl=False)
    elif not params["quiet"]:
        minutes = report.seconds / 60
        click.echo(f"{report.steps} steps in {minutes:.1f} min: {report.weights}", err=True)
