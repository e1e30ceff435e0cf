"""`lidaraccum accumulate`: frames in, one cloud out."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lidaraccum.cli import options
from lidaraccum.cli.door import Command
from lidaraccum.cli.progress import watch
from lidaraccum.cli.settings import (
    accumulate_settings,
    chosen_processes,
    open_source,
    reported,
    with_method,
)
from lidaraccum.errors import DoubtfulResultError

if TYPE_CHECKING:
    from lidaraccum.io.sequences import FileSequence
    from lidaraccum.pipeline.output import OutputSettings
    from lidaraccum.pipeline.report import AccumulationReport


@click.command(cls=Command)
@options.sequence_argument
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    help="The cloud: .ply .las .laz .pcd .npz.",
)
@click.option(
    "--no-sidecars", is_flag=True, help="Only the cloud: no poses, objects or report beside it."
)
@click.option(
    "--labels-dir",
    type=click.Path(path_type=Path),
    help="Also write SemanticKITTI .label files here, one a frame.",
)
@click.option(
    "--objects-dir",
    type=click.Path(path_type=Path),
    help="Also write each object's own cloud here.",
)
@click.option("--strict", is_flag=True, help="Exit with 4 when a pose is doubtful.")
@options.input_options
@options.registration_options
@options.result_options
@options.output_options
@options.processes_option
@options.talk_options
def accumulate(**params: Any) -> None:
    """Put a drive's frames into one clean, dense, labelled cloud.

    SEQ is a folder of frames, a glob, a list file, one multi-frame LAS file, several files in
    order, or - to read a list of files from stdin.
    """
    from lidaraccum.pipeline.output import OutputSettings, accumulate_to_files, check_outputs

    params = with_method(params)
    output = OutputSettings(
        path=params["output"],
        overwrite=params["overwrite"],
        sidecars=not params["no_sidecars"],
        labels_dir=params["labels_dir"],
        objects_dir=params["objects_dir"],
        settings=reported(params),
    )
    settings = accumulate_settings(params)
    check_outputs(output)
    sequence = open_source(params)
    if params["dry_run"]:
        _tell_plan(sequence, output)
        return
    if not params["quiet"]:
        _tell_found(sequence)
    quiet = params["quiet"] or params["no_progress"]
    shown = watch(len(sequence), quiet=quiet)
    processes = chosen_processes(params, len(sequence))
    report = accumulate_to_files(sequence, settings, output, watch=shown, processes=processes)
    _tell_result(report, output, as_json=params["as_json"], quiet=params["quiet"])
    if params["strict"] and report.doubtful:
        raise DoubtfulResultError(
            f"{len(report.doubtful)} of {report.frames} poses are doubtful",
            hint="the report names them",
        )


def _tell_found(sequence: FileSequence) -> None:
    info = sequence.info
    beside = info.poses_file is not None and info.poses_used.startswith("none")
    unused = f" ({info.poses_file} lies beside them; --poses auto uses it)" if beside else ""
    click.echo(
        f"{info.frames} frames of {info.source} ({info.layout}, {info.format}) at "
        f"{info.rate_hz:g} Hz ({info.rate_from}); poses: {info.poses_used}{unused}",
        err=True,
    )


def _tell_plan(sequence: FileSequence, output: OutputSettings) -> None:
    from lidaraccum.pipeline.output import planned_outputs

    info = sequence.info
    click.echo(f"would read {len(sequence)} frames of {info.source} ({info.layout}, {info.format})")
    for path in planned_outputs(output):
        click.echo(f"would write {path}")


def _tell_result(
    report: AccumulationReport, output: OutputSettings, *, as_json: bool, quiet: bool
) -> None:
    if as_json:
        from lidaraccum.io.atomic import json_text

        click.echo(json_text(asdict(report)), nl=False)
    if quiet:
        return
    for warning in report.warnings:
        click.echo(f"Warning: {warning}", err=True)
    click.echo(
        f"{report.points_written:,} points of {report.frames} frames in {output.path}: "
        f"{report.moving:,} moving, {report.still:,} movable but still, {report.objects} objects; "
        f"{report.trajectory_m:.1f} m driven, "
        f"points {100 * report.median_residual_m:.1f} cm from the map (median), "
        f"{sum(report.stage_seconds.values()):.1f} s",
        err=True,
    )
