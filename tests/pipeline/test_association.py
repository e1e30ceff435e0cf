"""One object, one id: over shared frames, over a gap, never for another motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lidaraccum.pipeline.association import Association
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import BALANCED
from lidaraccum.pipeline.objects import WindowObject


@pytest.fixture(scope="module")
def frames(busy_street: Any) -> list[SightedFrame]:
    return [SightedFrame(registered, BALANCED) for registered in busy_street.frames]


def mover(
    frames: list[int],
    rows: range,
    velocity: tuple[float, float, float] = (5.0, 0.0, 0.0),
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0),
    margin: float = 0.4,
) -> WindowObject:
    return WindowObject(
        picked={frame: np.array(rows) for frame in frames},
        velocity=np.array(velocity),
        centre=np.array(centre),
        stamp=frames[0] / 10,
        margin=margin,
    )


def test_movers_that_share_points_are_one(frames: list[SightedFrame]) -> None:
    association = Association(BALANCED)
    association.link([mover([0, 1, 2, 3, 4], range(20))], frames[:5])
    association.link([mover([2, 3, 4, 5, 6], range(5, 25))], frames[2:7])
    (track,) = association.tracks
    assert track.windows == 2
    assert set(track.picked) == set(range(7))
    assert len(track.picked[3]) == 25


def test_another_motion_is_another_object(frames: list[SightedFrame]) -> None:
    association = Association(BALANCED)
    association.link([mover([0, 1, 2, 3, 4], range(20))], frames[:5])
    association.link([mover([2, 3, 4, 5, 6], range(20), (-5.0, 0.0, 0.0))], frames[2:7])
    assert [track.instance for track in association.tracks] == [1, 2]


def test_a_lost_mover_is_met_again_where_it_must_be(frames: list[SightedFrame]) -> None:
    association = Association(BALANCED)
    association.link([mover([0, 1], range(20))], frames[:5])
    association.link([mover([5, 6], range(20), centre=(2.6, 0.3, 0.0))], frames[4:9])
    assert len(association.tracks) == 1
    association.link([mover([7, 8], range(20), centre=(9.0, 0.0, 0.0))], frames[4:9])
    assert len(association.tracks) == 2


def test_one_window_alone_is_believed_only_when_beyond_doubt(frames: list[SightedFrame]) -> None:
    association = Association(BALANCED)
    association.link([], frames[:5])
    faint, clear = mover([2], range(20)), mover([2], range(50, 70), margin=0.9)
    association.link([faint, clear], frames[2:7])
    assert [association.is_sure(track) for track in association.tracks] == [False, True]
    association.link([mover([4], range(20), centre=(1.0, 0.0, 0.0))], frames[4:9])
    assert all(association.is_sure(track) for track in association.tracks)


def test_what_is_long_gone_is_forgotten(frames: list[SightedFrame]) -> None:
    association = Association(BALANCED)
    association.link([mover([0], range(20))], frames[:5])
    association.tracks[0].stamp = -9.0
    association.link([], frames[2:7])
    assert association.tracks == []
