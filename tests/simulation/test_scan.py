"""What rays meet is what one mesh of everything would give; nothing is culled away."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.simulation.drive import DriveSettings, simulate
from lidaraccum.simulation.mesh import merge
from lidaraccum.simulation.raycast import Open3DRayCaster
from lidaraccum.simulation.scan import CLEAREST_PANE, Encounter, _not_swallowed, aim
from lidaraccum.simulation.surfaces import PASS_SHARE, Surface


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


def test_car_windows_swallow_what_went_in_each_car_by_its_own_share() -> None:
    count, cars = 20_000, np.arange(1, 41, dtype=np.int32)
    instance = np.repeat(cars, count)
    rays = np.arange(len(instance))

    def through(surface: Surface) -> tuple[np.ndarray, Encounter]:
        flat = np.ones(len(rays), dtype=np.float32)
        kinds = np.full(len(rays), surface, dtype=np.uint8)
        found = Encounter(5 * flat, kinds, flat, flat, instance)
        return _not_swallowed(found, rays, np.random.default_rng(0)), found

    kept, found = through(Surface.CAR_GLASS)
    shares = np.bincount(instance[kept], minlength=41)[1:] / count
    assert shares.max() < CLEAREST_PANE + 0.02
    assert np.ptp(shares) > 0.8 * CLEAREST_PANE
    assert np.isinf(np.delete(found.distance, kept)).all()
    assert np.isfinite(found.distance[kept]).all()
    assert len(through(Surface.LEAVES)[0]) == len(rays)
