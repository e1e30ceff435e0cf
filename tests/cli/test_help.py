"""`--help` is true and quick: it opens none of the heavy packages."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest

COMMANDS = (
    "accumulate",
    "mesh",
    "info",
    "simulate",
    "convert",
    "evaluate",
    "benchmark",
    "train",
    "config",
)


def test_help_names_every_command(run: Any) -> None:
    result = run("--help")
    assert result.exit_code == 0
    assert all(command in result.stdout for command in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_and_every_option_has_words(run: Any, command: str) -> None:
    from lidaraccum.cli.main import cli

    assert run(command, "--help").exit_code == 0
    for parameter in cli.commands[command].params:
        if parameter.param_type_name == "option":
            assert parameter.help, f"{command} {parameter.opts}"


def test_help_opens_nothing_heavy() -> None:
    program = (
        "import sys\n"
        "from lidaraccum.cli.main import cli\n"
        "try:\n    cli(['accumulate', '--help'])\n"
        "except SystemExit:\n    pass\n"
        "heavy = {'torch', 'open3d', 'numpy', 'scipy', 'laspy', 'small_gicp'} & set(sys.modules)\n"
        "sys.exit(' '.join(heavy) or 0)\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def test_a_wrong_option_is_a_usage_error(run: Any) -> None:
    result = run("accumulate", "--no-such-option")
    assert result.exit_code == 2
    assert "no-such-option" in result.stderr
