"""What a benchmark says, as types and as tables."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StageTime:
    """Wall time of one stage, median over runs."""

    stage: str
    seconds_per_frame: float


@dataclass(frozen=True)
class RivalTime:
    """Wall time of another odometry on the same frames.

    Attributes:
        name: Of the odometry.
        seconds_per_frame: Median over runs; NaN where it could not be run.
        ratio: Ours, streamed, over its, median over runs of the ratio within a run; NaN likewise.
        skipped: Why it was not run; empty when it was.
    """

    name: str
    seconds_per_frame: float
    ratio: float
    skipped: str = ""


@dataclass(frozen=True)
class BenchmarkReport:
    """What was timed.

    Attributes:
        sequence: Its name.
        frames: Frames run through.
        points_per_frame: Mean.
        repeat: Runs.
        window: Frames a window.
        read_seconds_per_frame: Reading from disk, once, before all else.
        stages: Of the streamed run.
        seconds_per_frame: Streamed: all frames as one sequence.
        seconds_per_window: Each window as a sequence of its own, the first motion found anew.
        peak_mb: Largest resident memory before any rival was opened, of the process, frames held in
            memory and libraries included, and of the one that registers.
        rivals: On the same frames, in the same runs, turn by turn.
    """

    sequence: str
    frames: int
    points_per_frame: float
    repeat: int
    window: int
    read_seconds_per_frame: float
    stages: tuple[StageTime, ...]
    seconds_per_frame: float
    seconds_per_window: float
    peak_mb: float
    rivals: tuple[RivalTime, ...]


def benchmark_markdown(report: BenchmarkReport) -> str:
    """The report as tables."""
    lines = [
        f"{report.frames} frames of {report.sequence}, {report.points_per_frame:,.0f} points each; "
        f"medians of {report.repeat} runs.",
        "",
        "| what | ms |",
        "| --- | --- |",
        f"| read a frame from disk (not counted below) | {_ms(report.read_seconds_per_frame)} |",
        *(f"| {one.stage}, a frame | {_ms(one.seconds_per_frame)} |" for one in report.stages),
        f"| all stages, a streamed frame | {_ms(report.seconds_per_frame)} |",
        f"| all stages, a window of {report.window} alone | {_ms(report.seconds_per_window)} |",
        "",
        f"Peak memory {report.peak_mb:,.0f} MB, the frames themselves included.",
        "",
        "| odometry on the same frames | ms a frame | ours takes |",
        "| --- | --- | --- |",
        *(_rival_line(one) for one in report.rivals),
    ]
    return "\n".join(lines) + "\n"


def _rival_line(one: RivalTime) -> str:
    if one.skipped:
        return f"| {one.name} | - | left out: {one.skipped} |"
    return f"| {one.name} | {_ms(one.seconds_per_frame)} | {one.ratio:.2f} times as long |"


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.1f}"
