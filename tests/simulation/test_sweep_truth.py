"""Where a rolling shutter's points were at the stamp: on the objects as they stood then."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.geometry.rigid import invert, transform
from lidaraccum.simulation.drive import DriveSettings, simulate


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("coordinates", ["sensor", "vehicle"])
def test_points_at_the_stamp_lie_on_what_they_are_of(
    compensated: bool, coordinates: str, distance_to: Callable[..., NDArray[np.float64]]
) -> None:
    settings = DriveSettings(
        seed=4, frames=1, sensor="VLP-16", rate_hz=5.0, scene="crossing", speed_mps=12.0,
        rolling_shutter=True, compensated=compensated, coordinates=coordinates, zeros=False,
        exact=True,
    )  # fmt: skip
    drive = simulate(settings)
    frame, labels = drive[0], drive.labels(0)
    world = transform(labels.world_from_sensor, labels.points_at_stamp)
    still = labels.annotated & (labels.instance == 0)
    assert np.quantile(distance_to(drive.world.mesh, world[still]), 0.999) < 0.005
    moved = 0
    for actor in drive.actors:
        own = labels.instance == actor.id
        if own.any():
            pose = actor.trajectory.poses_at(np.array([frame.stamp]))[0]
            local = transform(invert(pose), world[own])
            off = np.min([distance_to(mesh, local) for mesh in actor.model.phases], axis=0)
            assert np.quantile(off, 0.99) < 0.005
            moved += int(labels.dynamic[own].any())
    assert moved > 2
    if compensated:
        assert np.array_equal(frame.points[still], labels.points_at_stamp[still])
