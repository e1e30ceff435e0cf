"""How rough surfaces are, recorded and simulated: along a scan line, and across beams.

Usage: compare_surfaces.py RECORDING [--drives 16] [--dense 0] [--beam-bias 1]

RECORDING is a labelled sequence of an HDL-64E whose meta.json names SemanticKITTI's classes and
whose files hold one ring after another. Prints a Markdown table: by how much ranges of
neighbouring pulses on a surface differ (cm, quantiles; share above 30 cm), and how thick a surface
is within 40 cm of its points (cm, the smallest sigma; all beams together). Below 2.5 m, 5 to 20 m
away.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidaraccum.data.frame import Frame
from lidaraccum.evaluation.report_tables import Table
from lidaraccum.geometry.ground import level_by_ground
from lidaraccum.io.sequences import open_sequence
from lidaraccum.simulation.drive import DriveSettings, simulate
from lidaraccum.simulation.surfaces import Surface

Array = NDArray[np.float64]
Marked = tuple[Frame, NDArray[np.int64]]
Rough = tuple[Array, Array]
Row = list[str]
RECORDED = {"plants": "vegetation", "buildings": "building", "cars": "car", "road": "road"}
SIMULATED: Mapping[str, Sequence[int]] = {
    "plants": (Surface.HEDGE, Surface.LEAVES, Surface.THICKET),
    "buildings": (Surface.BUILDING,),
    "cars": (Surface.CAR_PAINT, Surface.CAR_GLASS, Surface.TRIM, Surface.TYRE),
    "road": (Surface.ROAD,),
}
NEIGHBOUR_RAD = 0.0045
REACH_M, TALLEST_M = (5.0, 20.0), 2.5
BALL_M, FEWEST, SAMPLE = 0.4, 12, 2000
FAR_M = 0.3


def recorded(folder: Path) -> Iterator[Marked]:
    """The frames of a recording and each point's class, ring after ring."""
    sequence = open_sequence(folder)
    for index in range(len(sequence)):
        semantic = sequence.labels(index).semantic
        if semantic is None:
            raise SystemExit(f"{folder} names no classes")
        yield sequence[index], semantic.astype(np.int64)


def simulated(drives: int, dense: float, beam_bias: float) -> Iterator[Marked]:
    """One frame of each of several suburban drives, ring after ring."""
    for seed in range(drives):
        settings = DriveSettings(
            seed=seed, frames=3, sensor="HDL-64E", rate_hz=10.0, scene="suburban", speed_mps=8.0,
            weather="clear", coordinates="sensor", zeros=False, compensated=True,
            rolling_shutter=True, dense=dense, beam_bias=beam_bias,
        )  # fmt: skip
        drive = simulate(settings)
        frame, semantic = drive[1], drive.labels(1).semantic
        assert frame.ring is not None
        assert frame.time_offset is not None
        assert semantic is not None
        order = np.lexsort((frame.time_offset, frame.ring))
        yield Frame(frame.points[order], frame.stamp), semantic[order].astype(np.int64)


def roughness(frame: Frame, chosen: Sequence[NDArray[np.bool_]]) -> list[Rough]:
    """Of each choice of points: jumps between neighbours along a line, thickness about a sample."""
    points = frame.points.astype(np.float64)
    ranges = np.maximum(np.linalg.norm(points, axis=1), 1e-6)
    ground, level = level_by_ground(points)
    near = (ranges > REACH_M[0]) & (ranges < REACH_M[1])
    near &= ground.height_above(level) < TALLEST_M
    turn = np.linalg.norm(np.diff(points / ranges[:, None], axis=0), axis=1)
    jump = np.abs(np.diff(ranges))
    found = []
    for one in chosen:
        fits = one & near
        beside = fits[1:] & fits[:-1] & (turn < NEIGHBOUR_RAD)
        found.append((jump[beside], thickness(points[fits])))
    return found


def thickness(points: Array) -> Array:
    """Smallest sigma, metres, of the points (N, 3) about some of them."""
    sample = np.random.default_rng(0).permutation(len(points))[:SAMPLE]
    balls = cKDTree(points).query_ball_point(points[sample], BALL_M)
    full = [ball for ball in balls if len(ball) >= FEWEST]
    flat = [np.linalg.eigvalsh(np.cov(points[ball].T))[0] for ball in full]
    return np.sqrt(np.maximum(flat, 0.0))


def rows(word: str, frames: Iterator[Marked], classes: Mapping[str, Sequence[int]]) -> list[Row]:
    """A line of the table for each kind of surface."""
    parts = [
        roughness(frame, [np.isin(semantic, own) for own in classes.values()])
        for frame, semantic in frames
    ]
    made = []
    for kind, found in zip(classes, zip(*parts, strict=True), strict=True):
        jumps, thick = (np.concatenate(column) for column in zip(*found, strict=True))
        cells = [f"{value:.1f}" for value in 100 * np.quantile(jumps, [0.25, 0.5, 0.75, 0.95])]
        cells += [f"{np.mean(jumps > FAR_M):.2f}", f"{100 * np.median(thick):.1f}"]
        made.append([f"{kind}, {word}", *cells])
    return made


def main() -> None:
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("--drives", type=int, default=16)
    parser.add_argument("--dense", type=float, default=0.0)
    parser.add_argument("--beam-bias", type=float, default=1.0)
    options = parser.parse_args()
    names = json.loads((options.recording / "meta.json").read_text())["classes"]
    classes = {kind: [names.index(name)] for kind, name in RECORDED.items()}
    drawn = simulated(options.drives, options.dense, options.beam_bias)
    pairs = zip(
        rows("recorded", recorded(options.recording), classes),
        rows("simulated", drawn, SIMULATED),
        strict=True,
    )
    titles = ("", "jump 25 %", "50 %", "75 %", "95 %", "> 30 cm", "thickness")
    print(Table("Roughness, cm", titles, [row for pair in pairs for row in pair]).markdown())


if __name__ == "__main__":
    main()
