"""What rays meet is what one mesh of everything would give; nothing is culled away."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.simulation.drive import DriveSettings, simulate
from lidaraccum.simulation.mesh import merge
from lidaraccum.simulation.raycast import Open3DRayCaster
from lidaraccum.simulation.scan import aim
from lidaraccum.simulation.surfaces import PASS_SHARE


@pytest.mark.parametrize("sensor", ["HDL-32E", "VLP-32C-pair"])
def test_actors_in_their_own_coordinates_are_hit_as_in_the_worlds(sensor: str) -> None:
    settings = DriveSettings(seed=4, frames=1, sensor=sensor, scene="crossing", exact=True)
    drive = simulate(settings)
    beams, columns = drive.drawn.sensor, 600
    azimuth, times = 2 * np.pi * np.arange(columns) / columns, np.zeros(columns)
    poses = drive.ego.trajectory.poses_at(times) @ drive.ego.vehicle_from_sensor
    rays = aim(beams, times, azimuth, poses, 0.0, np.random.default_rng(0))
    apart = drive._stage.meet(rays, beams, np.random.default_rng(0), 500.0)
    stood = [
        actor.mesh_at(0.0).posed(actor.trajectory.poses_at(np.zeros(1))[0])
        for actor in drive.actors
    ]
    together = merge([drive.world.mesh, *stood])
    bundle = np.concatenate([rays.origin, rays.direction], axis=2).reshape(-1, 6)
    hits = Open3DRayCaster().scene(together).cast(bundle)
    solid = (hits.triangle >= 0) & (PASS_SHARE[together.surface[hits.triangle]] == 0)
    assert (apart.instance > len(drive.world.stills)).sum() > 100
    off = np.abs(apart.distance[solid] - hits.distance[solid])
    assert np.mean(off < 0.005) > 0.9995
    assert np.array_equal(
        np.isfinite(apart.distance[hits.triangle < 0]), np.zeros((hits.triangle < 0).sum(), bool)
    )
