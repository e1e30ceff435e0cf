"""`lidaraccum simulate`: labelled drives out of a ray-cast world."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lidaraccum.cli import options
from lidaraccum.cli.door import Command
from lidaraccum.cli.progress import watch

if TYPE_CHECKING:
    from lidaraccum.simulation.drive import DriveSettings

Job = tuple["DriveSettings", Path, str, bool]


@click.command(cls=Command)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    help="The sequence's folder; with --count the folder of them all.",
)
@click.option(
    "--frames",
    allow_from_autoenv=False,
    type=click.IntRange(min=1),
    default=10,
    help="Frames a drive.",
)
@click.option(
    "--sensor", metavar="NAME", help="Such as HDL-64E or random; drawn by the seed without."
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    help="Of the first drive; the same seed gives the same bytes.",
)
@click.option(
    "--count", type=click.IntRange(min=1), default=1, help="Drives, with seeds counted up."
)
@click.option("--jobs", type=click.IntRange(min=1), default=1, help="Drives made at once.")
@click.option("--scene", metavar="NAME", help="Kind of street; drawn by the seed without.")
@click.option("--speed", type=float, metavar="M/S", help="Of the ego at the start; drawn without.")
@click.option("--rate", type=float, metavar="HZ", help="Turns a second; the sensor's own without.")
@click.option(
    "--format",
    "format_",
    envvar="LIDARACCUM_FORMAT",
    type=click.Choice(["laz", "ply", "bin"]),
    default="laz",
    help="Of the frames.",
)
@options.output_options
@options.talk_options
def simulate(**params: Any) -> None:
    """Make labelled drives through made-up streets, in the layout that accumulate reads."""
    from lidaraccum.io.atomic import check_free
    from lidaraccum.simulation.drive import DriveSettings

    first = DriveSettings(
        seed=params["seed"],
        frames=params["frames"],
        sensor=params["sensor"],
        scene=params["scene"],
        speed_mps=params["speed"],
        rate_hz=params["rate"],
    )
    jobs = planned(first, params)
    for _, folder, _, overwrite in jobs:
        check_free(folder, overwrite)
    if params["dry_run"]:
        click.echo("\n".join(f"would write {folder}" for _, folder, _, _ in jobs))
        return
    quiet = params["quiet"] or params["no_progress"]
    for folder in watch(len(jobs), quiet=quiet, what="drive")(made(jobs, params["jobs"])):
        if not params["quiet"]:
            click.echo(f"made {folder}", err=True)


def planned(first: DriveSettings, params: dict[str, Any]) -> list[Job]:
    """The drives to make: one in the output folder itself, or many in folders within."""
    output, count = params["output"], params["count"]
    drives = [replace(first, seed=first.seed + number) for number in range(count)]
    folders = [output] if count == 1 else [output / f"{drive.seed:06d}" for drive in drives]
    return [
        (drive, folder, params["format_"], params["overwrite"])
        for drive, folder in zip(drives, folders, strict=True)
    ]


def made(jobs: list[Job], at_once: int) -> Any:
    """Make the drives, several at once if so asked, and hand on each folder as it is done."""
    if at_once == 1:
        return map(make, jobs)
    pool = ProcessPoolExecutor(at_once, mp_context=get_context("spawn"))
    return pool.map(make, jobs)


def make(job: Job) -> Path:
    """Simulate one drive and write it."""
    from lidaraccum.io.labelled import LabelledSettings, write_labelled_sequence
    from lidaraccum.simulation.drive import simulate as simulate_drive

    settings, folder, kind, overwrite = job
    drive = simulate_drive(settings)
    how = LabelledSettings(
        format=kind,
        sensor=drive.drawn.sensor.name,
        licence="MIT; simulated by lidaraccum",
        notes={"simulation": asdict(settings)},
        overwrite=overwrite,
    )
    write_labelled_sequence(folder, drive, how)
    return folder
