"""Where frames meet a cluster under many hypotheses at once: the inner loop of every verdict."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.suspects import Template


def land(
    template: Template,
    velocities: NDArray[np.float64],
    turns: NDArray[np.float64],
    frame: SightedFrame,
) -> NDArray[np.float64]:
    """Where a frame meets a cluster that moves, for each of H motions.

    Each is carried along its `courses.course` from stamp to stamp, and on by the time that the
    sweep takes to come by.

    Args:
        template: The cluster, P points.
        velocities: (H, 3) m/s, world, at the template's stamp.
        turns: (H,) radians a second.
        frame: Who meets it.

    Returns:
        (3, H, P) metres, sensor coordinates: x, y and z in turn.
    """
    seconds = frame.stamp - template.stamp
    rotation, shift = frame.sensor_from_world[:3, :3], frame.sensor_from_world[:3, 3]
    if turns.any():
        moved = _turned(template, velocities, turns, seconds)
        local = (rotation @ moved.reshape(3, -1) + shift[:, None]).reshape(moved.shape)
    else:
        start = rotation @ template.world.T + shift[:, None]
        local = start[:, None] + (rotation @ velocities.T * seconds)[:, :, None]
    if frame.is_timed:
        # A sweep takes time, and the mover goes on meanwhile.
        later = frame.seconds_toward(local[0], local[1]) - template.seconds
        local += (rotation @ velocities.T)[:, :, None] * later
    return local


def _turned(
    template: Template,
    velocities: NDArray[np.float64],
    turns: NDArray[np.float64],
    seconds: float,
) -> NDArray[np.float64]:
    """The cluster (3, H, P), world, so many seconds on each course later: see `courses.course`."""
    half = 0.5 * seconds * turns
    chord = seconds * np.sinc(half / np.pi)
    x, y, z = velocities.T
    centre = np.empty((3, len(turns), 1))
    centre[0, :, 0] = (np.cos(half) * x - np.sin(half) * y) * chord
    centre[1, :, 0] = (np.sin(half) * x + np.cos(half) * y) * chord
    centre[2, :, 0] = z * chord
    centre += template.pivot[:, None, None]
    cosine, sine = np.cos(2 * half)[:, None], np.sin(2 * half)[:, None]
    east, north, up = (template.world - template.pivot).T
    moved = np.empty((3, len(turns), len(template.world)))
    moved[0] = cosine * east - sine * north
    moved[1] = sine * east + cosine * north
    moved[2] = up
    moved += centre
    return moved


def nearest(
    local: NDArray[np.float64],
    heights: NDArray[np.float64],
    frame: SightedFrame,
    reach_m: float,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Distance and row (H, P) of each landed point's nearest among the frame's near points.

    Args:
        local: (3, H, P) metres, sensor coordinates.
        heights: (P,) metres above the ground.
        frame: Whose points.
        reach_m: Distances beyond are inf, and their rows mean nothing.
    """
    x, y, _ = local
    places = np.empty((*x.shape, 3))
    places[..., 0], places[..., 1] = x, y
    np.multiply(frame.height_weight(x, y), heights, out=places[..., 2])
    distance, row = frame.tree.query(places, distance_upper_bound=reach_m)
    return distance, row
