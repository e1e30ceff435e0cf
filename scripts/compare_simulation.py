"""Sets simulated frames beside recorded ones of the same sensor: a table, histograms, pictures.

Usage: python scripts/compare_simulation.py RECORDINGS -o docs/images [--side-by-side DIR]

RECORDINGS holds the folders named in ``PAIRS``. Pictures written with ``--side-by-side`` show the
recordings, whose licences may forbid passing them on; the others show simulated frames only.
Needs matplotlib.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.io.sequences import open_sequence
from lidaraccum.simulation.drive import DriveSettings, simulate
from lidaraccum.simulation.sensor import SENSORS, Sensor

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from PIL import Image

PAIRS = {
    "kitti_0005": ("HDL-64E", "clear", ("suburban", "straight", "crossing", "curved")),
    "kitti_odom_00": ("HDL-64E", "clear", ("suburban", "curved", "straight")),
    "radiate_fog": ("HDL-32E", "fog", ("suburban", "straight", "crossing")),
    "ouster_os1_128": ("OS1-128", "clear", ("straight", "crossing", "industrial", "square")),
}
HEADER = """\
| recording | | lost | 25 % | 50 % | 75 % | 95 % | < 2 m | ground | over 2 m | per pillar |
|---|---|---|---|---|---|---|---|---|---|---|
"""
PILLAR_M = 0.25
SEEDS = 12
SHOWN = (1, 2, 3)


@dataclass(frozen=True, eq=False)
class Statistics:
    """What is compared, one row a frame."""

    returns_m: NDArray[np.float64]
    heights_m: NDArray[np.float64]
    pillar_counts: NDArray[np.float64]
    ring_share: NDArray[np.float64]
    drop: float


def rings_of(frame: Frame, sensor: Sensor) -> NDArray[np.int64]:
    """(N,) the beam nearest in elevation; recorded rings are not always kept."""
    flat = np.hypot(frame.points[:, 0], frame.points[:, 1])
    elevation = np.arctan2(frame.points[:, 2], flat)
    edges = 0.5 * (sensor.elevation[1:] + sensor.elevation[:-1])
    return np.searchsorted(edges, elevation)


def measure(frames: Iterable[Frame], sensor: Sensor, rate_hz: float) -> Statistics:
    """Statistics over frames."""
    ranges, heights, pillars, shares, drops = [], [], [], [], []
    full = sensor.columns_at(rate_hz)
    for frame in frames:
        back = frame.points[frame.returned]
        distance = np.linalg.norm(back, axis=1)
        ranges.append(distance)
        near = np.hypot(back[:, 0], back[:, 1]) < 15
        ground = np.percentile(back[near & (distance > 3), 2], 20)
        heights.append(back[:, 2] - ground)
        cells = np.floor(back[distance < 50, :2] / PILLAR_M).astype(np.int64)
        _, counts = np.unique(cells, axis=0, return_counts=True)
        pillars.append(counts)
        shares.append(
            np.bincount(rings_of(frame, sensor)[frame.returned], minlength=sensor.beams) / full
        )
        drops.append(1 - len(back) / (full * sensor.beams))
    return Statistics(
        np.concatenate(ranges), np.concatenate(heights), np.concatenate(pillars),
        np.mean(shares, axis=0), float(np.mean(drops)),
    )  # fmt: skip


def simulated(name: str, seeds: int) -> list[Frame]:
    """One frame of each of several scenes, set as the recording's."""
    sensor, weather, scenes = PAIRS[name]
    frames = []
    for seed in range(seeds):
        settings = DriveSettings(
            seed=seed, frames=3, sensor=sensor, rate_hz=10.0, scene=scenes[seed % len(scenes)],
            speed_mps=6.0, weather=weather, coordinates="sensor", zeros=False,
        )  # fmt: skip
        frames.append(simulate(settings)[1])
    return frames


def range_image(frame: Frame, sensor: Sensor, columns: int = 1400) -> NDArray[np.float64]:
    """(B, columns) metres, the highest beam on top; nan where nothing came back."""
    points = frame.points[frame.returned]
    bearing = np.arctan2(points[:, 1], points[:, 0])
    column = ((np.pi - bearing) / (2 * np.pi) * columns).astype(int) % columns
    image = np.full((sensor.beams, columns), np.nan)
    image[sensor.beams - 1 - rings_of(frame, sensor)[frame.returned], column] = np.linalg.norm(
        points, axis=1
    )
    return image


def save(figure: Figure, path: Path) -> None:
    """Write a small picture: 64 colours are enough."""
    figure.tight_layout()
    figure.savefig(path, dpi=58)
    plt.close(figure)
    with Image.open(path) as picture:
        small = picture.convert("RGB").quantize(64)
    small.save(path, optimize=True)


def draw_frames(frames: list[tuple[str, Frame]], sensor: Sensor, path: Path) -> None:
    """Bird's-eye views above range images, one column a frame."""
    figure, axes = plt.subplots(
        2, len(frames), figsize=(6.2 * len(frames), 8), height_ratios=[3.4, 1], squeeze=False
    )
    for (title, frame), (above, below) in zip(frames, axes.T, strict=True):
        x, y, z = frame.points[frame.returned].T
        low = np.percentile(z, 10)
        above.scatter(x, y, c=z, s=0.15, vmin=low - 0.5, vmax=low + 5, cmap="viridis", linewidths=0)
        above.set(xlim=(-45, 45), ylim=(-45, 45), aspect="equal", title=title)
        below.imshow(
            np.log(range_image(frame, sensor)), aspect="auto", cmap="turbo", interpolation="nearest"
        )
        below.set(xticks=[], yticks=[])
    save(figure, path)


def draw_histograms(name: str, real: Statistics, made: Statistics, path: Path) -> None:
    """Range, height, points per pillar and returns per ring, recorded and simulated."""
    figure, axes = plt.subplots(1, 4, figsize=(13, 2.8))
    panels: list[tuple[str, Callable[[Statistics], NDArray[np.float64]], NDArray[np.float64]]] = [
        ("range, m", lambda one: one.returns_m, np.linspace(0, 80, 60)),
        ("height above ground, m", lambda one: one.heights_m, np.linspace(-2, 8, 60)),
        ("points per 0.25 m pillar", lambda one: one.pillar_counts, np.geomspace(1, 200, 24)),
    ]
    for axis, (label, of, bins) in zip(axes, panels, strict=False):
        for word, statistics in (("recorded", real), ("simulated", made)):
            values = np.histogram(of(statistics), bins)[0] / len(of(statistics))
            axis.stairs(values, bins, label=word)
        axis.set(xlabel=label, yscale="log")
    axes[2].set_xscale("log")
    for word, statistics in (("recorded", real), ("simulated", made)):
        axes[3].plot(statistics.ring_share, label=f"{word}, {statistics.drop:.0%} lost")
    axes[3].set(xlabel="beam, lowest first", ylim=(0, 1.3))
    axes[3].legend(fontsize=7)
    axes[0].set_title(name, fontsize=9)
    save(figure, path)


def row(name: str, word: str, one: Statistics) -> str:
    """A line of the table."""
    quartiles = np.percentile(one.returns_m, [25, 50, 75, 95])
    low, high = np.mean(one.heights_m < 0.3), np.mean(one.heights_m > 2.0)
    near = np.mean(one.returns_m < 2.0)
    cells = " | ".join(f"{value:.1f}" for value in quartiles)
    return (
        f"| {name} | {word} | {one.drop:.2f} | {cells} | {near:.2f} | {low:.2f} | {high:.2f} | "
        f"{np.median(one.pillar_counts):.0f} / {one.pillar_counts.mean():.1f} |"
    )


def main() -> None:
    """Compare every pair that is there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--side-by-side", type=Path, help="folder for pictures with recordings")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    sys.stdout.write(HEADER)
    for name, (sensor_name, _, _) in PAIRS.items():
        sensor = SENSORS[sensor_name]()
        sequence = open_sequence(arguments.recordings / name)
        count = len(sequence)
        real = [sequence[index] for index in range(0, count, max(count // 6, 1))]
        made = simulated(name, arguments.seeds)
        first, second = measure(real, sensor, 10.0), measure(made, sensor, 10.0)
        for word, one in (("recorded", first), ("simulated", second)):
            sys.stdout.write(row(name, word, one) + "\n")
        draw_histograms(name, first, second, arguments.output / f"simulation_histograms_{name}.png")
        draw_frames(
            [(f"simulated, {sensor_name}, seed {seed}", made[seed]) for seed in SHOWN],
            sensor, arguments.output / f"simulation_frames_{name}.png",
        )  # fmt: skip
        if arguments.side_by_side:
            arguments.side_by_side.mkdir(parents=True, exist_ok=True)
            pairs = [(f"{name} recorded", real[0]), ("simulated", made[0]), ("simulated", made[2])]
            draw_frames(pairs, sensor, arguments.side_by_side / f"{name}.png")


if __name__ == "__main__":
    main()
