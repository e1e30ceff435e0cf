"""Waymo's range images: a pixel's row is its beam, its column the azimuth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid

Array = NDArray[np.float64]
RANGE, INTENSITY, ELONGATION, NO_LABEL_ZONE = range(4)
"""Channels of a range image."""


@dataclass(frozen=True, eq=False)
class LaserCalibration:
    """How a laser is mounted and where its beams point.

    Attributes:
        vehicle_from_laser: (4, 4).
        lowest_rad: Lower edge of the field of view.
        highest_rad: Upper edge.
        inclinations: (H,) of the beams, radians, ascending; None: evenly between the edges.
    """

    vehicle_from_laser: rigid.Pose
    lowest_rad: float
    highest_rad: float
    inclinations: Array | None = None

    def inclinations_of_rows(self, rows: int) -> Array:
        """Inclination (H,) of each row, radians; the top row is the highest beam.

        Raises:
            InputError: The calibration is for another number of rows.
        """
        if self.inclinations is None:
            edges = np.linspace(self.lowest_rad, self.highest_rad, rows + 1)
            return ((edges[:-1] + edges[1:]) / 2)[::-1]
        if len(self.inclinations) != rows:
            raise InputError(
                f"a range image has {rows} rows, its calibration {len(self.inclinations)} beams"
            )
        return self.inclinations[::-1]


@dataclass(frozen=True, eq=False)
class Pixels:
    """The pixels of a range image that came back.

    Attributes:
        row: (N,) from the top.
        column: (N,) from straight behind, clockwise seen from above.
        values: (N, 4) float32: range in metres, intensity, elongation, no-label zone.
        shape: Rows and columns of the image.
    """

    row: NDArray[np.intp]
    column: NDArray[np.intp]
    values: NDArray[np.float32]
    shape: tuple[int, int]

    @classmethod
    def of(cls, image: NDArray[np.float32]) -> Pixels:
        """Those of an image (H, W, 4) with a range above 0."""
        row, column = np.nonzero(image[..., RANGE] > 0)
        return cls(row, column, image[row, column], (image.shape[0], image.shape[1]))


def vehicle_points(pixels: Pixels, calibration: LaserCalibration) -> Array:
    """Points (N, 3), metres, in the vehicle's coordinates as each was measured.

    The columns count from straight behind the vehicle, whichever way the laser is turned.
    """
    height, width = pixels.shape
    mount = calibration.vehicle_from_laser
    turned = np.arctan2(mount[1, 0], mount[0, 0])
    azimuth = np.pi * (1.0 - 2.0 * (pixels.column + 0.5) / width) - turned
    inclination = calibration.inclinations_of_rows(height)[pixels.row]
    distance = pixels.values[:, RANGE].astype(np.float64)
    flat = distance * np.cos(inclination)
    local = np.stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(inclination)], axis=1
    )
    return rigid.transform(mount, local)


def compensated(
    points: Array, pixels: Pixels, pose_image: NDArray[np.float32], world_from_vehicle: rigid.Pose
) -> Array:
    """The points (N, 3) in the coordinates of the vehicle at the frame's own pose.

    Args:
        points: (N, 3) metres, vehicle coordinates as each was measured.
        pixels: Where they are in the image.
        pose_image: (H, W, 6) roll, pitch, yaw in radians and place in metres: the vehicle's pose in
            the world as each pixel was measured; the turn is yaw about z, then pitch, then roll.
        world_from_vehicle: (4, 4) of the frame.
    """
    poses = pose_image[pixels.row, pixels.column].astype(np.float64)
    cr, cp, cy = np.cos(poses[:, :3]).T
    sr, sp, sy = np.sin(poses[:, :3]).T
    x, y, z = points.T
    # Roll, then pitch, then yaw, column by column: a frame has a hundred thousand rotations.
    y, z = cr * y - sr * z, sr * y + cr * z
    x, z = cp * x + sp * z, cp * z - sp * x
    x, y = cy * x - sy * y, sy * x + cy * y
    world = np.stack([x, y, z], axis=1) + poses[:, 3:]
    return rigid.transform(rigid.invert(world_from_vehicle), world)
