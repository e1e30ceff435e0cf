"""Ego-motion of a whole sequence from points alone, or from given poses, checked or refined."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.errors import InputError
from lidaraccum.registration.opening import Opening, step_between
from lidaraccum.registration.passage import Passage
from lidaraccum.registration.scan import StaticMask, prepare
from lidaraccum.registration.settings import RegistrationSettings
from lidaraccum.registration.tracker import CONTRADICTION_M

CLEARLY_MORE = 0.05
"""Poses are contradicted by others only where so much more of the points fits."""


def register(
    frames: Iterable[Frame],
    settings: RegistrationSettings | None = None,
    given: NDArray[np.float64] | None = None,
    static_mask: StaticMask | None = None,
) -> Iterator[RegisteredFrame]:
    """Find where the sensor was in every frame.

    Frames leave in order, each exactly once, all its points in order; the first few leave together,
    after the motion they started with is known. Memory does not grow with the sequence.

    Args:
        frames: In order; at least one.
        settings: What registration may be told; defaults when None.
        given: (T, 4, 4) world_from_sensor for each frame, used as ``settings.poses_mode`` says.
        static_mask: Says which points of a frame (N,) registration may use.

    Yields:
        Frames with world_from_sensor at their stamps. The world is frame 0's sensor coordinates
        (less its origin, where frames are georeferenced), or that of the given poses.

    Raises:
        InputError: Fewer or more given poses than frames.
    """
    settings = settings or RegistrationSettings()
    stream = iter(enumerate(frames))
    opening = [
        prepare(index, frame, settings, static_mask)
        for index, frame in islice(stream, settings.lookahead)
    ]
    passage = Passage(settings, given)
    opened = Opening(passage, opening).solve()
    if given is not None and settings.poses_mode == "given":
        # Poses of another drive, inverted or all identity show in the first steps already.
        free = Opening(Passage(settings, None), opening).solve()
        opened = compared(opened, free)
    yield from opened
    count = len(opening)
    del opening
    for index, frame in stream:
        count += 1
        yield passage.follow(prepare(index, frame, settings, static_mask))
    if given is not None and len(given) != count:
        raise InputError(f"there are {len(given)} poses for {count} frames")


def compared(held: list[RegisteredFrame], free: list[RegisteredFrame]) -> list[RegisteredFrame]:
    """Frames at their given poses, doubted where the points alone say another step."""
    frames = held[:1]
    for (held_before, held_now), (free_before, free_now) in zip(
        pairwise(held), pairwise(free), strict=True
    ):
        given_m = step_between(held_before, held_now)
        found_m = step_between(free_before, free_now)
        away_m = float(np.linalg.norm(given_m - found_m))
        clearer = free_now.quality.overlap > held_now.quality.overlap + CLEARLY_MORE
        if away_m < CONTRADICTION_M or free_now.quality.doubts or not clearer:
            frames.append(held_now)
            continue
        contradiction = f"the points say a step {away_m:.1f} m other than the given poses"
        quality = replace(held_now.quality, doubts=(*held_now.quality.doubts, contradiction))
        frames.append(replace(held_now, quality=quality))
    return frames
