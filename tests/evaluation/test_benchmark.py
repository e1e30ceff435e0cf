"""The benchmark counts everything once; what it says of time is left to who runs it."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from lidaraccum.data.frame import Frame
from lidaraccum.errors import InputError, MissingDependencyError, SettingsError
from lidaraccum.evaluation.benchmark import BenchmarkSettings, benchmark
from lidaraccum.evaluation.benchmark_report import benchmark_markdown
from lidaraccum.evaluation.rivals import OPEN3D, RIVALS, Rival
from lidaraccum.io.sequences import open_sequence
from lidaraccum.io.settings import InputSettings


class Clockwork:
    """A rival that takes 1 s, then 2 s, and remembers how many frames it was shown."""

    def __init__(self) -> None:
        self.shown: list[int] = []

    def run(self, frames: Sequence[Frame]) -> float:
        self.shown.append(len(frames))
        return float(len(self.shown))


def missing(frames: Sequence[Frame]) -> float:
    raise MissingDependencyError("it is not installed")


def test_every_run_takes_every_rival_over_the_same_frames(bins: Path) -> None:
    clockwork = Clockwork()
    rivals = (Rival("clockwork", clockwork.run), Rival("missing", missing))
    settings = BenchmarkSettings(repeat=2, window=3, rivals=rivals)
    report = benchmark(open_sequence(bins), settings)
    assert clockwork.shown == [6, 6]
    timed, left_out = report.rivals
    assert timed.seconds_per_frame == pytest.approx(1.5 / 6)
    assert timed.ratio > 0
    assert left_out.skipped
    assert math.isnan(left_out.ratio)
    assert {"register", "perceive", "place"} <= {one.stage for one in report.stages}
    assert report.seconds_per_frame > 0
    assert report.seconds_per_window > 0
    assert 10 < report.peak_mb < 100_000
    text = benchmark_markdown(report)
    assert "it is not installed" in text
    assert "nan" not in text


def test_open3d_runs_where_it_is_installed(bins: Path) -> None:
    frames = [open_sequence(bins)[index] for index in range(2)]
    assert OPEN3D.run(frames) > 0


@pytest.mark.parametrize("rival", RIVALS, ids=lambda rival: rival.name)
def test_a_rival_that_is_not_installed_is_said_to_be(
    rival: Rival, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in ("kiss_icp", "kiss_icp.config.parser", "kiss_icp.kiss_icp", "open3d"):
        monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingDependencyError, match="benchmark"):
        rival.run([])


def test_fewer_frames_than_a_window_and_no_runs_are_refused(bins: Path) -> None:
    with pytest.raises(InputError, match="2 frames"):
        benchmark(open_sequence(bins, InputSettings(frames="0:2")), BenchmarkSettings(window=3))
    with pytest.raises(SettingsError):
        BenchmarkSettings(repeat=0)
