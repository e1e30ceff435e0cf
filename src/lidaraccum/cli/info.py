"""`lidaraccum info`: what is in a sequence, before anything is done with it."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from lidaraccum.cli import options
from lidaraccum.cli.door import Command
from lidaraccum.cli.settings import open_source

if TYPE_CHECKING:
    from lidaraccum.io.sequences import SequenceInfo
    from lidaraccum.pipeline.inspection import Inspection


@click.command(cls=Command)
@options.sequence_argument
@click.option("--sample", type=click.IntRange(min=1), default=10, help="Frames to look into.")
@options.input_options
@options.talk_options
def info(**params: Any) -> None:
    """Say what was found in a sequence: frames, points, fields, extent, rate, sensor, warnings.

    SEQ is whatever accumulate takes.
    """
    from lidaraccum.pipeline.inspection import inspect

    sequence = open_source(params)
    inspection = inspect(sequence, params["sample"])
    if params["as_json"]:
        found = {"sequence": asdict(sequence.info), "inspection": asdict(inspection)}
        click.echo(json.dumps(found, indent=1, default=str))
        return
    for name, text in _lines(sequence.info, inspection):
        click.echo(f"{name:<12} {text}")


def _lines(info: SequenceInfo, inspection: Inspection) -> list[tuple[str, str]]:
    low, high = inspection.extent_m
    beams = f"{inspection.beams} beams" if inspection.beams else "no beams to be told apart"
    looks = f", looks like {inspection.sensor}" if inspection.sensor else ""
    lowest, highest = inspection.elevation_deg
    share = f"{100 * inspection.without_return:.1f} % without return, "
    share += f"{100 * inspection.dropped:.1f} % not finite"
    lines = [
        ("source", f"{info.source} ({info.layout}, {info.format})"),
        ("frames", f"{info.frames} at {info.rate_hz:g} Hz ({info.rate_from}; {info.times_from})"),
        ("points", f"{inspection.points_per_frame:,} a frame ({share})"),
        ("fields", " ".join(inspection.fields)),
        ("extent", "  ".join(f"{a:.1f}..{b:.1f} m" for a, b in zip(low, high, strict=True))),
        ("range", f"{inspection.median_range_m:.1f} m (median)"),
        ("sensor", f"{beams}, {lowest:.1f}..{highest:.1f} deg{looks}"),
        ("poses", f"{info.poses_file or 'none'} ({info.poses_used})"),
        ("labels", info.labels or "none"),
        ("crs", (info.crs_wkt or "none").split(",")[0]),
    ]
    return lines + [("warning", warning) for warning in info.warnings]
