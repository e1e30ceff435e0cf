"""Real signals to a real process: nothing half-written stays behind."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest


def start(folder: Path, out: Path, *more: object) -> subprocess.Popen[str]:
    """Start accumulate in a process of its own and wait until it is writing."""
    command = [sys.executable, "-m", "lidaraccum", "accumulate", folder, "-o", out, *more]
    command.append("--no-network")  # killed while it writes, not while it thinks
    process = subprocess.Popen(
        [str(part) for part in command],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        # Under a shell's background job the interrupt would be ignored from the start.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and process.poll() is None:
        if any(path.stat().st_size > 100_000 for path in out.parent.glob(f".{out.name}*")):
            return process
        time.sleep(0.005)
    raise AssertionError(f"it never began to write: {process.communicate()}")


@pytest.fixture
def long_drive(drive: Any, tmp_path: Path) -> Path:
    """The street forth and back, long enough to be interrupted."""
    folder = tmp_path / "seq"
    folder.mkdir()
    forth_and_back = [*range(6), *range(4, 0, -1)] * 30
    for number, index in enumerate(forth_and_back):
        np.save(folder / f"{number}.npy", drive.frames[index])
    return folder


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_says_so_and_leaves_nothing(
    long_drive: Path, tmp_path: Path, number: signal.Signals
) -> None:
    process = start(long_drive, tmp_path / "out.ply", "--labels-dir", tmp_path / "labels")
    process.send_signal(number)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stderr
    assert "Interrupted" in stderr
    assert "Traceback" not in stderr
    assert stdout == ""
    assert [path.name for path in tmp_path.iterdir()] == ["seq"]


def test_a_killed_run_leaves_nothing_under_the_final_names(
    long_drive: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.laz"
    process = start(long_drive, out, "--labels-dir", tmp_path / "labels")
    process.kill()
    process.communicate(timeout=60)
    assert not out.exists()
    assert not (tmp_path / "labels").exists()
    assert not list(tmp_path.glob("out.*"))


def children_of(process: subprocess.Popen[str]) -> list[int]:
    """The processes that a process has started."""
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    return [int(number) for number in listed.read_text().split()]


def is_running(process: int) -> bool:
    """Whether a process is there and not merely waiting to be forgotten."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="asks Linux for processes")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_no_process_outlives_the_one_that_started_it(
    long_drive: Path, tmp_path: Path, number: signal.Signals
) -> None:
    process = start(long_drive, tmp_path / "out.ply", "--processes", 2)
    children = children_of(process)
    assert children
    process.send_signal(number)
    process.communicate(timeout=60)
    deadline = time.monotonic() + 30
    while any(map(is_running, children)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_running, children))
