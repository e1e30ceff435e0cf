"""Frames made ready elsewhere are those made ready here."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np

from lidaraccum.data.frame import Frame
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import BALANCED
from lidaraccum.pipeline.sighting import Sighter


def test_a_frame_that_was_sent_sees_and_is_seen_as_before(busy_street: Any) -> None:
    here = list(Sighter(BALANCED).all(busy_street.frames[:3]))
    sighter = pickle.loads(pickle.dumps(Sighter(BALANCED)))
    there = [pickle.loads(pickle.dumps(sighter(one))) for one in busy_street.frames[:3]]
    for frames in (here, there):
        for one in frames:
            for other in frames:
                one.watch(other)
    assert any(frame.through.any() for frame in here)
    for one, other in zip(here, there, strict=True):
        for name in ("rows", "low_rows", "near_points", "segments", "through", "met"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        np.testing.assert_array_equal(one.tree.data, other.tree.data)


def test_a_frame_without_points_can_be_sent(busy_street: Any) -> None:
    stamp = busy_street.frames[0].frame.stamp
    empty = replace(busy_street.frames[0], frame=Frame(np.zeros((0, 3), np.float32), stamp))
    sent: SightedFrame = pickle.loads(pickle.dumps(Sighter(BALANCED)(empty)))
    full = Sighter(BALANCED)(busy_street.frames[1])
    sent.watch(full)
    assert len(sent.rows) == 0
    assert not full.through.any()
    assert not full.met.any()
