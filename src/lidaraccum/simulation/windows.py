"""Which seeds train and which test: two ranges that cannot meet, and the fixed test set."""

from __future__ import annotations

from collections.abc import Iterator

from lidaraccum.errors import SettingsError
from lidaraccum.simulation.drive import SimulatedSequence, simulate
from lidaraccum.simulation.raycast import RayCaster
from lidaraccum.simulation.sensor import RANDOM_SENSOR, SENSORS
from lidaraccum.simulation.settings import DriveSettings

FIRST_TEST_SEED = 2_000_000_000
"""Seeds from here on are for tests; those below for training."""
TEST_WINDOWS = 200
TEST_SPEEDS_MPS = (0.0, 3.0, 7.0, 11.0, 15.0, 20.0, 25.0, 30.0)
TEST_FRAMES = 5
STRIDE = 61
"""From one window of a sample to the next; without a factor in common with what is sampled."""


def training_settings(index: int, frames: int = TEST_FRAMES) -> DriveSettings:
    """Settings of training drive ``index``: everything drawn by its seed.

    Raises:
        SettingsError: When the seed would be one of the test set's.
    """
    if not 0 <= index < FIRST_TEST_SEED:
        raise SettingsError(f"training seeds are 0 to {FIRST_TEST_SEED - 1}, not {index}")
    return DriveSettings(seed=index, frames=frames)


def held_out_settings(index: int, frames: int = TEST_FRAMES) -> DriveSettings:
    """Settings of test window ``index``: every sensor meets every speed, the rest is drawn.

    Raises:
        SettingsError: When there is no such window.
    """
    if not 0 <= index < TEST_WINDOWS:
        raise SettingsError(f"the test set has windows 0 to {TEST_WINDOWS - 1}, not {index}")
    names = [*SENSORS, RANDOM_SENSOR]
    return DriveSettings(
        seed=FIRST_TEST_SEED + index,
        frames=frames,
        sensor=names[index % len(names)],
        speed_mps=TEST_SPEEDS_MPS[(index // len(names)) % len(TEST_SPEEDS_MPS)],
    )


def held_out_numbers(count: int) -> list[int]:
    """So many windows of the test set in which sensors take turns and every speed comes up.

    Any number begins like a larger one, so few windows are a sample of many.

    Raises:
        SettingsError: When there are not so many.
    """
    if not 1 <= count <= TEST_WINDOWS:
        raise SettingsError(f"the test set has {TEST_WINDOWS} windows, not {count}")
    return [number * STRIDE % TEST_WINDOWS for number in range(count)]


def held_out_windows(caster: RayCaster | None = None) -> Iterator[SimulatedSequence]:
    """The test set, one window after another, each simulated when asked for."""
    return (simulate(held_out_settings(index), caster) for index in range(TEST_WINDOWS))
