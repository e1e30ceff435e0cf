"""`lidaraccum evaluate`: how good a method is, beside others and the paper."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lidaraccum.cli import options
from lidaraccum.cli.door import Command
from lidaraccum.cli.progress import watch

if TYPE_CHECKING:
    from lidaraccum.data.sequence import LabelledSequence
    from lidaraccum.evaluation.evaluate import EvaluationReport, EvaluationSettings


class Lengths(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """Window lengths, ``3..10`` or ``3,5,9``."""

    name = "lengths"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, ...]:
        """The lengths, in order."""
        if isinstance(value, (list, tuple)):
            return tuple(int(part) for part in value)
        first, dots, last = str(value).partition("..")
        try:
            if dots:
                return tuple(range(int(first), int(last) + 1))
            return tuple(int(part) for part in first.split(","))
        except ValueError:
            self.fail(f"{value!r} is not lengths like 3..10 or 3,5", param, ctx)


@click.command(cls=Command)
@click.argument("sequence", nargs=-1, type=click.Path(path_type=Path), metavar="SEQ...")
@click.option(
    "--simulated",
    type=click.IntRange(1, 200),
    metavar="N",
    help="Score N of the 200 windows of the simulated test set, sensors in turn.",
)
@click.option("--still-shutter", is_flag=True, help="Simulate those without rolling shutter.")
@click.option(
    "--method",
    multiple=True,
    default=("ego-only",),
    metavar="NAME",
    help="What to score; may be given several times, 'all' for all.",
)
@options.weights_option
@click.option("--window", type=click.IntRange(min=2), default=5, help="Frames a window.")
@click.option(
    "--stride",
    type=click.IntRange(min=0),
    default=0,
    help="Frames from window to window; 0 side by side.",
)
@click.option(
    "--target",
    type=click.Choice(["first", "middle", "last"]),
    default="first",
    help="The frame of a window that the others are taken to.",
)
@click.option(
    "--given-poses", is_flag=True, help="Give the true poses; otherwise they are estimated."
)
@click.option(
    "--half-width",
    type=float,
    default=32.0,
    metavar="M",
    help="Score this far ahead, behind and aside of the sensor; 0 everywhere.",
)
@click.option(
    "--above-ground",
    type=float,
    default=0.0,
    metavar="M",
    help="Score only points so far above the ground, as the paper does; 0 all.",
)
@click.option(
    "--deskew",
    type=click.Choice(["auto", "off"]),
    default="auto",
    help="Undo the sensor's motion within each frame; where labels take points as recorded, off.",
)
@click.option("--frames", metavar="A:B:C", help="Only these frames, as a slice: start:stop:step.")
@click.option("--by-gap", is_flag=True, help="Also EPE by frames between source and target.")
@click.option(
    "--by-part", is_flag=True, help="Also scores by range, kind, speed, ego speed and sensor."
)
@click.option("--per-scene", is_flag=True, help="Also averages over sequences, with deviation.")
@click.option("--by-length", type=Lengths(), metavar="3..10", help="Also EPE by window length.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Write the whole report: .json .md .html (one page with plots).",
)
@click.option("--overwrite", is_flag=True, help="Replace a report that exists.")
@options.talk_options
def evaluate(**params: Any) -> None:
    """Score methods on labelled drives: scene flow, motion, instances, poses.

    SEQ is a labelled sequence, or a folder of them as simulate makes with --count.
    """
    from lidaraccum.evaluation.evaluate import evaluate as score
    from lidaraccum.evaluation.report import check_report, write_report

    if params["output"]:
        check_report(params["output"], overwrite=params["overwrite"])
    settings = _settings(params)
    drives, count = _drives(params)
    quiet = params["quiet"] or params["no_progress"]
    report = score(watch(count, quiet=quiet, what="drive")(drives), settings)
    if params["output"]:
        write_report(params["output"], report, overwrite=params["overwrite"])
    _tell(report, params)


def _settings(params: dict[str, Any]) -> EvaluationSettings:
    from lidaraccum.evaluation.baselines import all_names
    from lidaraccum.evaluation.evaluate import EvaluationSettings
    from lidaraccum.evaluation.truth import Scope
    from lidaraccum.registration.settings import RegistrationSettings

    named = tuple(params["method"])
    return EvaluationSettings(
        methods=all_names(params["weights"]) if named == ("all",) else named,
        weights=params["weights"],
        length=params["window"],
        stride=params["stride"],
        target=params["target"],
        lengths=params["by_length"] or (),
        given_poses=params["given_poses"],
        scope=Scope(params["half_width"], params["above_ground"]),
        registration=RegistrationSettings(deskew=params["deskew"]),
    )


def _drives(params: dict[str, Any]) -> tuple[Iterable[LabelledSequence], int]:
    """The drives to score and how many they are."""
    if bool(params["sequence"]) == bool(params["simulated"]):
        raise click.UsageError("give labelled sequences, or --simulated N")
    if params["simulated"]:
        longest = max((params["window"], *(params["by_length"] or ())))
        wanted = params["simulated"]
        return _simulated(wanted, longest, still=params["still_shutter"]), wanted
    folders = [drive for path in params["sequence"] for drive in _folders(path)]
    return _opened(folders, params["frames"] or ""), len(folders)


def _simulated(count: int, frames: int, *, still: bool) -> Iterator[LabelledSequence]:
    from lidaraccum.simulation.drive import simulate
    from lidaraccum.simulation.windows import held_out_numbers, held_out_settings

    for number in held_out_numbers(count):
        settings = held_out_settings(number, frames)
        yield simulate(replace(settings, rolling_shutter=False) if still else settings)


def _folders(path: Path) -> list[Path]:
    """The path itself, or the labelled sequences in it."""
    inside = sorted(child.parent for child in path.glob("*/labels"))
    return inside if inside and not (path / "labels").exists() else [path]


def _opened(folders: Iterable[Path], frames: str) -> list[LabelledSequence]:
    """All of them, so that what cannot be scored is said before any work; none is read yet."""
    from lidaraccum.errors import InputError
    from lidaraccum.io.sequences import open_sequence
    from lidaraccum.io.settings import InputSettings

    opened = [open_sequence(str(folder), InputSettings(frames=frames)) for folder in folders]
    for folder, sequence in zip(folders, opened, strict=True):
        if not sequence.has_labels:
            raise InputError(f"{folder} has no labels", hint="a labels folder beside its frames")
    return list(opened)


def _tell(report: EvaluationReport, params: dict[str, Any]) -> None:
    from lidaraccum.evaluation.report_json import as_json
    from lidaraccum.evaluation.report_tables import Sections, markdown

    if params["as_json"]:
        click.echo(as_json(report), nl=False)
    else:
        sections = Sections(
            scenes=params["per_scene"], gaps=params["by_gap"], parts=params["by_part"]
        )
        click.echo(markdown(report, sections), nl=False)
