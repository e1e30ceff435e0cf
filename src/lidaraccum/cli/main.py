"""The entry point: `lidaraccum COMMAND`."""

from __future__ import annotations

import os

import click

import lidaraccum
from lidaraccum.cli.accumulate import accumulate
from lidaraccum.cli.benchmark import benchmark
from lidaraccum.cli.config import config
from lidaraccum.cli.convert import convert
from lidaraccum.cli.evaluate import evaluate
from lidaraccum.cli.info import info
from lidaraccum.cli.mesh import mesh
from lidaraccum.cli.simulate import simulate
from lidaraccum.cli.train import train

# Before NumPy is opened: its products are of small matrices here, and threads only wait in them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(lidaraccum.__version__, prog_name="lidaraccum")
def cli() -> None:
    """Turn a raw LiDAR drive into one clean, dense, labelled point cloud.

    Exit codes: 0 done, 1 a fault of ours, 2 usage, 3 unreadable input, 4 a doubtful result under
    --strict, 130 interrupted.
    """


for command in (accumulate, mesh, info, simulate, convert, evaluate, benchmark, train, config):
    cli.add_command(command)
