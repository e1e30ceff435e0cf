"""Odometry's cold start where few things stand and the sensor is sparse, on simulated drives.

    python scripts/open_country.py [--seeds 8]

Prints how far off the last of four frames is, and what the report would say of it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from lidaraccum.geometry import rigid
from lidaraccum.registration.odometry import register
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.settings import DriveSettings

FRAMES = 4
FAR_OFF_M = 0.15
HIGHWAY = DriveSettings(
    frames=FRAMES, sensor="HDL-32E", scene="highway", speed_mps=28.0, rate_hz=20.0,
    rolling_shutter=False, weather="clear", manoeuvre="cruise",
)  # fmt: skip
RURAL = replace(HIGHWAY, scene="rural", speed_mps=4.0)
SPARSE = replace(
    RURAL, sensor="VLP-16", speed_mps=18.0, rate_hz=10.0, rolling_shutter=True,
    compensated=False, coordinates="sensor",
)  # fmt: skip


def main() -> None:
    """Run all drives."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=8)
    errors = []
    for seed in range(1, parser.parse_args().seeds + 1):
        for settings in (HIGHWAY, SPARSE, RURAL):
            drive = simulate(replace(settings, seed=seed))
            first, last = (drive.labels(index).world_from_sensor for index in (0, FRAMES - 1))
            found = list(register(drive[index] for index in range(FRAMES)))
            off = rigid.invert(rigid.invert(first) @ last) @ found[-1].world_from_sensor
            errors.append(float(np.linalg.norm(off[:3, 3])))
            doubts = sorted({doubt for frame in found for doubt in frame.quality.doubts})
            what = f"{settings.sensor}, {settings.scene}, {settings.speed_mps:.0f} m/s, seed {seed}"
            print(f"{what}: {errors[-1]:.2f} m", *doubts, sep="; ", flush=True)
    error = np.array(errors)
    near = error <= FAR_OFF_M
    print(f"over {FAR_OFF_M} m: {(~near).sum()} of {len(error)}; others {error[near].mean():.3f} m")


if __name__ == "__main__":
    main()
