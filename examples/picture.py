"""Draws accumulated clouds from above, side by side, as a PNG: before and after.

    python examples/picture.py before.ply after.ply -o picture.png

Brightness is the number of points, orange what moves, blue what could but stands.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from matplotlib import pyplot as plt

from lidaraccum.data.accumulation import MOVING, STILL
from lidaraccum.io.clouds import Cloud, read_cloud

GREY, BLUE, ORANGE = (
    np.array([0.85, 0.9, 0.95]),
    np.array([0.3, 0.6, 1.0]),
    np.array([1.0, 0.55, 0.1]),
)


def from_above(cloud: Cloud, centre: np.ndarray, radius_m: float, pixels: int) -> np.ndarray:
    """The cloud as an image (pixels, pixels, 3), x to the right, y up."""
    cell = ((cloud.positions[:, :2] - centre + radius_m) / (2 * radius_m) * pixels).astype(int)
    inside = np.all((cell >= 0) & (cell < pixels), axis=1)
    image = np.zeros((pixels, pixels, 3))
    for colour, chosen in (
        (GREY, cloud.label < STILL),
        (BLUE, cloud.label == STILL),
        (ORANGE, cloud.label == MOVING),
    ):
        rows = cell[inside & chosen]
        counts = np.zeros((pixels, pixels))
        np.add.at(counts, (pixels - 1 - rows[:, 1], rows[:, 0]), 1)
        image += (np.log1p(counts) / np.log(60))[..., None] * colour
    return np.clip(image, 0, 1)


@click.command()
@click.argument("clouds", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@click.option("--radius", default=40.0, help="Half the edge of what is shown, metres.")
@click.option(
    "--centre", nargs=2, type=float, help="Middle of what is shown: x y; else the median."
)
@click.option("--pixels", default=900)
def main(
    clouds: tuple[Path, ...],
    output: Path,
    radius: float,
    centre: tuple[float, float] | None,
    pixels: int,
) -> None:
    """Draw CLOUDS from above, side by side."""
    _, panels = plt.subplots(1, len(clouds), figsize=(7 * len(clouds), 7.4), squeeze=False)
    for panel, path in zip(panels[0], clouds, strict=True):
        cloud = read_cloud(path)
        middle = np.median(cloud.positions[:, :2], axis=0) if centre is None else np.array(centre)
        panel.imshow(from_above(cloud, middle, radius, pixels))
        panel.set_title(path.stem.replace("_", " "))
        panel.axis("off")
    plt.tight_layout()
    plt.savefig(output, dpi=pixels / 7)


if __name__ == "__main__":
    main()
