"""Times both ray casters on one simulated drive and compares what they hit.

Usage: compare_casters.py [--seed 7] [--frames 3] [--sensor HDL-64E] [--rounds 5]. Times are CPU
seconds of all threads, the least of the rounds, the two casters taking turns.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.drive import DriveSettings, simulate
from lidaraccum.simulation.mesh import Mesh
from lidaraccum.simulation.raycast import (
    EmbreexRayCaster,
    Hits,
    Open3DRayCaster,
    RayCaster,
    RayScene,
)


class Timed:
    """A caster that keeps its own time and answers."""

    def __init__(self, caster: RayCaster) -> None:
        self.caster = caster
        self.seconds = 0.0
        self.answers: list[Hits] = []

    def scene(self, mesh: Mesh) -> RayScene:
        """The mesh, ready; Open3D builds its tree in the first cast."""
        began = time.process_time()
        made = TimedScene(self, self.caster.scene(mesh))
        self.seconds += time.process_time() - began
        return made


class TimedScene:
    """Its scene."""

    def __init__(self, timed: Timed, scene: RayScene) -> None:
        self._timed = timed
        self._scene = scene

    def cast(self, rays: NDArray[np.float32]) -> Hits:
        """Nearest hits."""
        began = time.process_time()
        hits = self._scene.cast(rays)
        self._timed.seconds += time.process_time() - began
        self._timed.answers.append(Hits(hits.distance.copy(), hits.triangle.copy()))
        return hits


def run(caster: RayCaster, settings: DriveSettings) -> tuple[float, Timed]:
    """CPU seconds of the whole drive, and the caster's own."""
    timed = Timed(caster)
    began = time.process_time()
    for _ in simulate(settings, timed):
        pass
    return time.process_time() - began, timed


def main() -> None:
    """Both casters, in turns."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--frames", type=int, default=3)
    parser.add_argument("--sensor", default="HDL-64E")
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    settings = DriveSettings(seed=given.seed, frames=given.frames, sensor=given.sensor)
    casters: tuple[RayCaster, ...] = (Open3DRayCaster(), EmbreexRayCaster())
    rounds = [[run(caster, settings) for caster in casters] for _ in range(given.rounds)]
    for place, name in enumerate(("open3d", "embreex")):
        whole = min(one[place][0] for one in rounds)
        casting = min(one[place][1].seconds for one in rounds)
        print(f"{name:8} drive {whole:.3f} s, of which building and casting {casting:.3f} s")
    compare(*(timed.answers for _, timed in rounds[0]))


def compare(ours: list[Hits], theirs: list[Hits]) -> None:
    """How many rays meet another triangle, and how far apart the hits are."""
    mine = np.concatenate([hits.triangle for hits in ours])
    its = np.concatenate([hits.triangle for hits in theirs])
    reach = np.concatenate([hits.distance for hits in ours])
    other = np.concatenate([hits.distance for hits in theirs])
    both = np.isfinite(reach) & np.isfinite(other)
    apart = np.abs(reach[both] - other[both]).max()
    print(f"{len(mine)} rays, {np.count_nonzero(mine != its)} meet another triangle,")
    print(f"distances at most {apart:.1e} m apart")


if __name__ == "__main__":
    main()
