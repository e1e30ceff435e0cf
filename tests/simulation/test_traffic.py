"""Movers keep clear of each other and of the ego, in short drives and in long ones."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.simulation.drive import DriveSettings, simulate


@pytest.mark.parametrize(("scene", "frames"), [("crossing", 5), ("highway", 60)])
def test_nobody_drives_through_anybody(scene: str, frames: int) -> None:
    settings = DriveSettings(
        seed=3, frames=frames, sensor="VLP-16", rate_hz=10.0, scene=scene, speed_mps=10.0
    )
    drive = simulate(settings)
    assert len(drive.actors) > 3
    times = np.linspace(0, frames / 10.0, 40)
    tracks = [drive.ego.trajectory.place_at(times)]
    widths = [1.8]
    for actor in drive.actors:
        tracks.append(actor.trajectory.place_at(times))
        widths.append(min(actor.model.size_lwh[:2]))
    for first in range(len(tracks)):
        for second in range(first):
            gap = np.linalg.norm(tracks[first][:, :2] - tracks[second][:, :2], axis=1)
            assert gap.min() > 0.45 * (widths[first] + widths[second])


def test_some_stand_some_go_and_ids_are_their_own() -> None:
    drive = simulate(DriveSettings(seed=11, frames=3, sensor="VLP-16", scene="crossing"))
    ids = [movable.id for movable in drive.movables.everyone]
    assert ids == list(range(1, len(ids) + 1))
    speeds = drive.movables.speeds_at(0.1)
    assert (speeds[: len(drive.world.stills)] == 0).all()
    assert (speeds > 0.5).any()
    assert speeds.max() < 45.0
