"""`lidaraccum config`: which settings `accumulate` would run with, and where each comes from."""

from __future__ import annotations

import json
from typing import Any

import click
from click.core import ParameterSource

from lidaraccum.cli import options
from lidaraccum.cli.door import Command
from lidaraccum.cli.settings import TALK, reported, with_method

_SOURCES = {
    ParameterSource.COMMANDLINE: "flag",
    ParameterSource.ENVIRONMENT: "environment",
    ParameterSource.DEFAULT_MAP: "file",
    ParameterSource.DEFAULT: "default",
}


@click.command(cls=Command)
@options.input_options
@options.registration_options
@options.result_options
@options.talk_options
def config(**params: Any) -> None:
    """Show the settings of accumulate as TOML, and where each comes from.

    Flags win over LIDARACCUM_* in the environment, over the --config file, over defaults. What is
    printed can be saved and given to --config.
    """
    ctx = click.get_current_context()
    params = with_method(params)
    values = reported(params)
    if params["as_json"]:
        click.echo(json.dumps(values, indent=1))
        return
    names = [name for name in params if name not in TALK]
    for name, (key, value) in zip(names, values.items(), strict=True):
        source = ctx.get_parameter_source(name)
        origin = _SOURCES.get(source, "default") if source else "default"
        # TOML has no null: what is not set is shown but commented out.
        line = f"# {key} =" if value is None else f"{key} = {json.dumps(value)}"
        click.echo(f"{line:<34} # {origin}")
