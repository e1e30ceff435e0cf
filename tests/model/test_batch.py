"""The door: what goes in comes out, in any order, alone or in company."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lidaraccum.data.frame import Frame
from lidaraccum.errors import InputError, SettingsError
from lidaraccum.model.batch import FrameTensors, prepare, to_arrays, to_tensors
from lidaraccum.model.settings import NetworkSettings


def same(one: FrameTensors, other: FrameTensors) -> bool:
    tensors = ("points", "height", "rows", "pillar", "pillar_cell", "pillar_mean")
    return all(torch.equal(getattr(one, name), getattr(other, name)) for name in tensors)


def test_rows_lead_back_to_the_points(frames: list[Frame], settings: NetworkSettings) -> None:
    prepared = prepare(frames[0], settings)
    sensor_from_level = np.linalg.inv(prepared.level_from_sensor)
    back = prepared.points @ sensor_from_level[:3, :3].T + sensor_from_level[:3, 3]
    np.testing.assert_allclose(back, frames[0].points[prepared.rows], atol=1e-4)


def test_pillars_are_where_their_points_are(frames: list[Frame], settings: NetworkSettings) -> None:
    tensors = to_tensors([prepare(frame, settings) for frame in frames[:2]])
    centre = tensors.pillar_centres()[tensors.pillar]
    off = (tensors.points[:, :2] - centre).abs()
    assert float(off.max()) <= 0.5 * settings.pillar_m + 1e-4
    assert torch.equal(tensors.point_frame, tensors.pillar_frame[tensors.pillar])


def test_select_undoes_stack(frames: list[Frame], settings: NetworkSettings) -> None:
    prepared = [prepare(frame, settings) for frame in frames[:3]]
    together = to_tensors(prepared)
    for index, frame in enumerate(prepared):
        assert same(together.select(index), to_tensors([frame]))
    again = FrameTensors.stack([together.select(index) for index in range(3)])
    assert same(again, together)
    assert again.stamps == together.stamps


def test_points_that_did_not_return_are_left_out(settings: NetworkSettings) -> None:
    points = np.array([[0, 0, 0], [1, 2, 0], [200, 0, 0]], dtype=np.float32)
    assert prepare(Frame(points), settings).rows.tolist() == [1]


@pytest.mark.parametrize("place", [0.0, 500.0])
def test_a_frame_without_a_point_on_the_grid_is_refused(
    place: float, settings: NetworkSettings
) -> None:
    with pytest.raises(InputError):
        prepare(Frame(np.full((3, 3), place, dtype=np.float32)), settings)


def test_the_grid_must_halve_evenly(frames: list[Frame], settings: NetworkSettings) -> None:
    assert prepare(frames[0], settings, 48.0).cells == 192
    with pytest.raises(SettingsError):
        prepare(frames[0], settings, 33.0)


def test_answers_are_plain_arrays() -> None:
    array = to_arrays(torch.ones(2, dtype=torch.bfloat16, requires_grad=True))
    assert array.dtype == np.float64
    assert array.tolist() == [1.0, 1.0]
