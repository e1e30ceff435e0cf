"""The one door through which every command is entered and every error leaves."""

from __future__ import annotations

import logging
import signal
import sys
from types import FrameType
from typing import Any

import click

from lidaraccum.errors import (
    DoubtfulResultError,
    InputError,
    LidarAccumError,
    OutputError,
    OutputExistsError,
    SettingsError,
)

DONE, FAULT, USAGE, UNREADABLE, DOUBTFUL, INTERRUPTED = 0, 1, 2, 3, 4, 130

_CODES: tuple[tuple[type[LidarAccumError], int], ...] = (
    (InputError, UNREADABLE),
    (SettingsError, USAGE),
    (OutputExistsError, USAGE),
    (OutputError, USAGE),
    (DoubtfulResultError, DOUBTFUL),
)


class Command(click.Command):
    """A command whose errors are one sentence and an exit code."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        settings = {"auto_envvar_prefix": "LIDARACCUM", "show_default": True}
        kwargs["context_settings"] = settings | kwargs.get("context_settings", {})
        super().__init__(*args, **kwargs)

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        """Parse; a value of a kind that no option takes (a list in TOML, say) is a usage error."""
        try:
            return super().make_context(*args, **kwargs)
        except TypeError as error:
            raise click.UsageError(f"a setting is of the wrong kind: {error}") from error

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; turn what it raises into talk on stderr and an exit code."""
        _set_up_talk(ctx.params)
        signal.signal(signal.SIGTERM, _interrupt)
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit):
            raise
        except (KeyboardInterrupt, click.Abort):
            click.echo("Interrupted; nothing half-written was left behind.", err=True)
            ctx.exit(INTERRUPTED)
        except BrokenPipeError:
            # Whoever read our stdout has gone; nobody is left to tell.
            sys.stderr.close()
            ctx.exit(DONE)
        except Exception as error:
            if ctx.params.get("traceback"):
                logging.getLogger("lidaraccum").exception("the error came from here")
            click.echo(f"Error: {sentence(error)}", err=True)
            ctx.exit(exit_code(error))


def exit_code(error: Exception) -> int:
    """The exit code that an error stands for."""
    for kind, code in _CODES:
        if isinstance(error, kind):
            return code
    return FAULT


def sentence(error: Exception) -> str:
    """What to tell the user about an error, in one sentence with a hint."""
    if isinstance(error, LidarAccumError):
        return str(error)
    if isinstance(error, MemoryError):
        return "out of memory (fewer --frames, a --crop or a --voxel need less)"
    told = " ".join(str(error).split()) or "no message"
    return f"a fault of ours, {type(error).__name__}: {told} (--traceback shows where)"


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _set_up_talk(params: dict[str, Any]) -> None:
    level = logging.WARNING
    if params.get("quiet"):
        level = logging.ERROR
    elif params.get("verbose"):
        level = logging.INFO
    logger = logging.getLogger("lidaraccum")
    logger.handlers[:] = [_EchoHandler()]
    logger.setLevel(level)
    logger.propagate = False


class _EchoHandler(logging.Handler):
    """Writes to whatever stderr is at the time, around a progress bar."""

    def emit(self, record: logging.LogRecord) -> None:
        from tqdm import tqdm

        tqdm.write(f"{record.levelname.title()}: {self.format(record)}", file=sys.stderr)
