"""Options that several commands share, each defined once.

A setting comes from its flag, then ``LIDARACCUM_NAME`` in the environment, then the TOML file
given with ``--config``, then its default. A table in the file is for the command of its name alone.
"""

from __future__ import annotations

import difflib
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

Function = Callable[..., Any]
Decorator = Callable[[Function], Function]


class Numbers(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """Numbers parted by commas; a list in the TOML file."""

    name = "numbers"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        """Any of ``1,2,3``, ``[1, 2, 3]`` or an empty text as a tuple of floats."""
        parts = value.split(",") if isinstance(value, str) else value
        try:
            return tuple(float(part) for part in parts if str(part).strip())
        except (TypeError, ValueError):
            self.fail(f"{value!r} is not a list of numbers like 1,2,3", param, ctx)


TABLES = ("train",)
"""Commands that have settings beyond their options; the other commands pass over their tables."""
_META = "lidaraccum.tables"


def read_toml(path: Path) -> dict[str, Any]:
    """What a TOML file says; a usage error when it is none."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise click.BadParameter(f"{path} is not TOML: {error}") from error


def _load_config(ctx: click.Context, param: click.Parameter, path: Path | None) -> Path | None:
    """Take settings from a TOML file; keys are the long options' names."""
    if path is None:
        return None
    known = {
        flag[2:]: option.name
        for option in ctx.command.params
        for flag in option.opts
        if isinstance(option, click.Option) and flag.startswith("--") and option.name != param.name
    }
    content = read_toml(path)
    ctx.meta[_META] = {name: content.pop(name) for name in TABLES if name in content}
    values = {}
    for key, value in content.items():
        name = known.get(key.replace("_", "-"))
        if name is None:
            near = difflib.get_close_matches(key.replace("_", "-"), known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise click.BadParameter(f"{path} sets {key!r}, which no option has{hint}")
        values[name] = value
    ctx.default_map = {**(ctx.default_map or {}), **values}
    return path


def table_of(ctx: click.Context, name: str) -> Mapping[str, Any]:
    """The table of that name in the ``--config`` file; empty when there is none."""
    table = ctx.meta.get(_META, {}).get(name, {})
    if not isinstance(table, Mapping):
        raise click.BadParameter(f"{name!r} is a table in the TOML file, not {table!r}")
    return table


def _stack(*decorators: Decorator) -> Decorator:
    def decorate(function: Function) -> Function:
        for wrap in reversed(decorators):
            function = wrap(function)
        return function

    return decorate


sequence_argument = click.argument("sequence", nargs=-1, required=True, metavar="SEQ...")

input_options = _stack(
    click.option(
        "--frames", metavar="A:B:C", help="Only these frames, as a slice: start:stop:step."
    ),
    click.option("--rate", type=float, metavar="HZ", help="Frames a second, where no stamps say."),
    click.option(
        "--format",
        "format_",
        envvar="LIDARACCUM_FORMAT",
        metavar="SUFFIX",
        help="In a mixed folder: which files.",
    ),
    click.option(
        "--bin-fields",
        metavar="NAMES",
        help="Fields of .bin files: x,y,z,intensity,...",
    ),
    click.option(
        "--split-by",
        metavar="FIELD",
        help="Split one LAS file into frames: point_source_id, gps_time or any field.",
    ),
    click.option(
        "--poses",
        metavar="FILE",
        help="Poses to use, KITTI or TUM; 'auto' for those found.",
    ),
)

registration_options = _stack(
    click.option(
        "--poses-mode",
        type=click.Choice(["given", "refine"]),
        default="given",
        help="Take given poses as they are, or as a start.",
    ),
    click.option(
        "--deskew",
        type=click.Choice(["auto", "off"]),
        default="auto",
        help="Undo the sensor's motion within each frame where the frames need it.",
    ),
)

processes_option = click.option(
    "--processes",
    type=click.IntRange(1, 2),
    metavar="1|2",
    show_default="2 where there are cores and frames enough",
    help="With 2, frames find their place and are made ready in a process of its own.",
)

weights_option = click.option(
    "--weights",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="The network's weights; without it those that came with the package.",
)

result_options = _stack(
    click.option(
        "--method",
        type=click.Choice(["network", "label-free", "ego-only", "oracle"]),
        show_default="network where there are weights, else label-free",
        help="What finds movers: the network verified by geometry, geometry alone, nothing, or "
        "labels that came along.",
    ),
    weights_option,
    click.option("--no-network", is_flag=True, help="Geometry alone finds movers: label-free."),
    click.option(
        "--preset",
        type=click.Choice(["conservative", "balanced", "aggressive"]),
        default="balanced",
        help="How readily something is called moving.",
    ),
    click.option(
        "--reference",
        default="first",
        metavar="FRAME",
        help="Whose coordinates: first, middle, last, an index, or world with given poses.",
    ),
    click.option(
        "--voxel", type=float, default=0.0, metavar="M", help="Keep one point a voxel; 0 all."
    ),
    click.option(
        "--crop",
        type=Numbers(),
        metavar="X0,Y0,X1,Y1",
        help="Keep only this box of the cloud; six numbers give z as well.",
    ),
    click.option("--min-range", type=float, default=0.0, metavar="M", help="Drop nearer points."),
    click.option(
        "--max-range", type=float, default=0.0, metavar="M", help="Drop farther points; 0 for none."
    ),
    click.option(
        "--drop-dynamic",
        "--static-only",
        is_flag=True,
        envvar=["LIDARACCUM_DROP_DYNAMIC", "LIDARACCUM_STATIC_ONLY"],
        help="The clean map: drop what moves.",
    ),
)

output_options = _stack(
    click.option("--overwrite", is_flag=True, help="Replace outputs that exist."),
    click.option("--dry-run", is_flag=True, help="Say what would be read and written, do nothing."),
)

talk_options = _stack(
    click.option(
        "--config",
        type=click.Path(exists=True, dir_okay=False, path_type=Path),
        is_eager=True,
        callback=_load_config,
        help="Settings from a TOML file, keys named like the options.",
    ),
    click.option(
        "--json",
        "as_json",
        is_flag=True,
        envvar="LIDARACCUM_JSON",
        help="Print the summary as JSON.",
    ),
    click.option("--no-progress", is_flag=True, help="No progress bar; none without a terminal."),
    click.option("-q", "--quiet", is_flag=True, help="Say only what went wrong."),
    click.option("-v", "--verbose", is_flag=True, help="Say what is being done."),
    click.option("--traceback", is_flag=True, help="Show where an error came from."),
)


def chosen_source(sequence: Sequence[str]) -> str | list[str]:
    """What the SEQ arguments mean: one source, many files, or ``-`` for a list on stdin."""
    if list(sequence) == ["-"]:
        return [line.strip() for line in sys.stdin if line.strip()]
    return sequence[0] if len(sequence) == 1 else list(sequence)
