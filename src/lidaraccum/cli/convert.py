"""`lidaraccum convert`: logs of driving data sets in the layout that the other commands read."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lidaraccum.cli import options
from lidaraccum.cli.door import Command
from lidaraccum.cli.progress import watch

if TYPE_CHECKING:
    from lidaraccum.io.driving.convert import Converted


@click.command(cls=Command)
@click.argument("dataset", type=click.Choice(["nuscenes", "waymo", "argoverse2"]))
@click.argument("source", metavar="SRC", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    metavar="DIR",
    type=click.Path(path_type=Path),
    required=True,
    help="Each log becomes DIR/NAME.",
)
@click.option(
    "--scene",
    "--log",
    "names",
    metavar="NAME",
    multiple=True,
    allow_from_autoenv=False,
    help="Only this scene, segment or log; may be given often. All without.",
)
@click.option(
    "--version",
    metavar="NAME",
    allow_from_autoenv=False,
    help="Of nuScenes, such as v1.0-mini, where SRC holds several.",
)
@click.option(
    "--format",
    "format_",
    envvar="LIDARACCUM_FORMAT",
    type=click.Choice(["ply", "laz", "bin"]),
    default="ply",
    help="Of the frames: ply keeps every bit, laz 1 mm and whole numbers of intensity.",
)
@options.output_options
@options.talk_options
def convert(**params: Any) -> None:
    """Turn nuScenes, Waymo (v2) or Argoverse 2 logs into labelled sequences.

    SRC is the folder of nuScenes, of one Waymo split (it holds lidar/, lidar_box/, ...), of one
    Argoverse 2 split, or of one Argoverse 2 log. The data stay under their own licence.
    """
    from lidaraccum.io.atomic import check_free
    from lidaraccum.io.driving.datasets import chosen_names, open_dataset

    dataset = open_dataset(params["dataset"], params["source"], params["version"])
    names = chosen_names(dataset, params["names"])
    for name in names:
        check_free(params["output"] / name, params["overwrite"])
    if params["dry_run"]:
        click.echo("\n".join(f"would write {params['output'] / name}" for name in names))
        return
    quiet = params["quiet"] or params["no_progress"]
    done = list(watch(len(names), quiet=quiet, what="log")(made(dataset, names, params)))
    if params["as_json"]:
        click.echo(json.dumps([summary(one) for one in done], indent=2))


def made(dataset: Any, names: tuple[str, ...], params: dict[str, Any]) -> Iterator[Converted]:
    """Convert one log after the other and say what became of each."""
    from lidaraccum.io.driving.convert import convert_log

    for name in names:
        folder = params["output"] / name
        log = dataset.open(name)
        one = convert_log(log, folder, format=params["format_"], overwrite=params["overwrite"])
        if not params["quiet"]:
            click.echo(
                f"made {folder}: {one.frames} sweeps, {one.objects} objects, {one.moving} moving",
                err=True,
            )
        yield one


def summary(one: Converted) -> dict[str, Any]:
    """What ``--json`` says of a log."""
    return {
        "folder": str(one.folder),
        "frames": one.frames,
        "objects": one.objects,
        "moving": one.moving,
    }
