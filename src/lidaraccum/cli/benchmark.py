"""`lidaraccum benchmark`: how long it takes here, beside odometry on the same frames."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import click

from lidaraccum.cli import options
from lidaraccum.cli.door import Command
from lidaraccum.cli.settings import chosen_processes, open_source


@click.command(cls=Command)
@options.sequence_argument
@click.option("--repeat", type=click.IntRange(min=1), default=3, help="Runs; medians are told.")
@click.option("--window", type=click.IntRange(min=2), default=5, help="Frames a window.")
@click.option("--method", default="ego-only", metavar="NAME", help="What finds movers.")
@options.weights_option
@options.processes_option
@options.input_options
@options.registration_options
@options.talk_options
def benchmark(**params: Any) -> None:
    """Time each stage, a streamed frame and a window, and others' odometry beside.

    SEQ is whatever accumulate takes; --frames 0:20 keeps it short. kiss-icp and Open3D are timed
    where they are installed; the extra 'benchmark' brings them.
    """
    from lidaraccum.evaluation.benchmark import BenchmarkSettings
    from lidaraccum.evaluation.benchmark import benchmark as measure
    from lidaraccum.evaluation.benchmark_report import benchmark_markdown
    from lidaraccum.pipeline.accumulator import AccumulateSettings
    from lidaraccum.registration.settings import RegistrationSettings

    registration = RegistrationSettings(deskew=params["deskew"], poses_mode=params["poses_mode"])
    sequence = open_source(params)
    settings = BenchmarkSettings(
        accumulate=AccumulateSettings(
            method=params["method"], weights=params["weights"], registration=registration
        ),
        repeat=params["repeat"],
        window=params["window"],
        processes=chosen_processes(params, len(sequence)),
    )
    report = measure(sequence, settings)
    if params["as_json"]:
        content = asdict(report)
        for rival in content["rivals"]:
            if rival["skipped"]:
                rival["seconds_per_frame"] = rival["ratio"] = None
        click.echo(json.dumps(content, indent=1))
    else:
        click.echo(benchmark_markdown(report), nl=False)
