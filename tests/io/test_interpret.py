"""Which column means what, in which unit, from which origin."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lidaraccum.errors import InputError
from lidaraccum.io.columns import Columns
from lidaraccum.io.interpret import Occasion, frame_from_columns

Cloud = Callable[..., NDArray[np.float32]]
SWEEP = np.linspace(0, 0.0999, 200)


def frame_of(points: NDArray[Any], occasion: Occasion | None = None, **columns: Any) -> Any:
    return frame_from_columns(Columns(points, columns), occasion or Occasion("a"))


@pytest.mark.parametrize("name", ["intensity", "Intensity", "reflectivity", "remission", "i"])
def test_intensity_by_any_name_in_its_own_type(cloud: Cloud, name: str) -> None:
    values = np.arange(200, dtype=np.uint16)
    frame = frame_of(cloud(), **{name: values})
    np.testing.assert_array_equal(frame.intensity, values)
    assert frame.intensity.dtype == np.uint16
    assert not frame.attributes


def test_what_is_not_the_intensity_stays(cloud: Cloud) -> None:
    frame = frame_of(cloud(), reflectivity=np.arange(200), intensity=np.ones(200))
    np.testing.assert_array_equal(frame.intensity, np.ones(200))
    np.testing.assert_array_equal(frame.attributes["reflectivity"], np.arange(200))


def test_a_ring_of_whole_floats_becomes_integer(cloud: Cloud) -> None:
    frame = frame_of(cloud(), ring=(np.arange(200) % 32).astype(np.float32))
    assert frame.ring.dtype == np.uint16
    fractional = frame_of(cloud(), ring=np.arange(200) / 3)
    assert fractional.ring is None
    assert "ring" in fractional.attributes


@pytest.mark.parametrize(
    "values",
    [SWEEP, SWEEP * 1e3, SWEEP * 1e6, (SWEEP * 1e9).astype(np.uint32), SWEEP.astype(np.float32)],
    ids=["s", "ms", "us", "ns", "float32"],
)
def test_time_in_any_unit(cloud: Cloud, values: NDArray[Any]) -> None:
    frame = frame_of(cloud(), Occasion("a", stamp=7.0), t=values)
    np.testing.assert_allclose(frame.time_offset, SWEEP, atol=1e-6)
    assert frame.stamp == 7.0
    np.testing.assert_array_equal(frame.attributes["t"], values)


def test_time_before_the_stamp_stays_before_it(cloud: Cloud) -> None:
    frame = frame_of(cloud(), Occasion("a", stamp=7.0, exact=True), time=SWEEP - 0.1)
    np.testing.assert_allclose(frame.time_offset, SWEEP - 0.1, atol=1e-12)
    np.testing.assert_array_equal(frame.attributes["input_time"], SWEEP - 0.1)


def test_a_clock_among_the_points_gives_the_stamp(cloud: Cloud) -> None:
    nanoseconds = (1_700_000_000 * 10**9) + (SWEEP * 1e9).astype(np.int64)
    frame = frame_of(cloud(), Occasion("a", stamp=3.0), timestamp=nanoseconds)
    assert frame.stamp == pytest.approx(1.7e9, abs=1e-6)
    np.testing.assert_allclose(frame.time_offset, SWEEP, atol=2e-9)


def test_a_clock_near_a_recorded_stamp_counts_from_it(cloud: Cloud) -> None:
    occasion = Occasion("a", stamp=1000.05, exact=True)
    frame = frame_of(cloud(), occasion, gps_time=1000.0 + SWEEP)
    assert frame.stamp == 1000.05
    np.testing.assert_allclose(frame.time_offset, SWEEP - 0.05, atol=1e-9)


def test_another_clock_than_the_recorded_stamps(cloud: Cloud) -> None:
    occasion = Occasion("a", stamp=5.0, exact=True)
    frame = frame_of(cloud(), occasion, gps_time=123456.0 + SWEEP)
    assert frame.stamp == 5.0
    np.testing.assert_allclose(frame.time_offset, SWEEP, atol=1e-9)


@pytest.mark.parametrize(
    "values",
    [np.zeros(200), np.full(200, 5.0), SWEEP * 50, np.full(200, np.nan)],
    ids=["zero", "constant", "too long", "nan"],
)
def test_what_is_no_time_within_a_rotation_is_none(cloud: Cloud, values: NDArray[Any]) -> None:
    frame = frame_of(cloud(), time=values)
    assert frame.time_offset is None
    np.testing.assert_array_equal(frame.attributes["input_time"], values)


def test_names_of_our_own_outputs_are_carried_apart(cloud: Cloud) -> None:
    values = np.arange(200)
    frame = frame_of(cloud(), label=values, frame=values, input_label=values + 1)
    assert set(frame.attributes) == {"input_frame", "input_input_label", "input_label"}
    np.testing.assert_array_equal(frame.attributes["input_label"], values + 1)


def test_non_finite_points_are_dropped_and_rows_remember(cloud: Cloud) -> None:
    points = cloud()
    points[[3, 7], [0, 2]] = np.nan, np.inf
    frame = frame_of(points, intensity=np.arange(200))
    assert (len(frame), frame.row_count) == (198, 200)
    np.testing.assert_array_equal(frame.rows, np.delete(np.arange(200), [3, 7]))
    np.testing.assert_array_equal(frame.intensity, frame.rows)


def test_points_without_return_are_kept_and_do_not_count_as_near(cloud: Cloud) -> None:
    points = np.concatenate([np.zeros((900, 3), np.float32), cloud()])
    frame = frame_of(points)
    assert len(frame) == 1100
    assert np.count_nonzero(frame.returned) == 200


def test_utm_survives_to_a_millimetre(cloud: Cloud) -> None:
    there = cloud().astype(np.float64) + np.array([500_000.123, 5_400_000.456, 312.789])
    frame = frame_of(there)
    np.testing.assert_array_equal(frame.origin, np.round(frame.origin))
    back = frame.points.astype(np.float64) + frame.origin
    np.testing.assert_allclose(back, there, rtol=0, atol=1e-4)


def test_no_return_is_known_among_georeferenced_points(cloud: Cloud) -> None:
    there = cloud().astype(np.float64) + np.array([500_000.0, 5_400_000.0, 300.0])
    there[:7] = 0.0
    np.testing.assert_array_equal(np.flatnonzero(~frame_of(there).returned), np.arange(7))


@pytest.mark.parametrize(
    ("factor", "unit"), [(1000.0, "millimetres"), (0.001, "kilometres")], ids=["mm", "km"]
)
def test_absurd_units_are_said(cloud: Cloud, factor: float, unit: str) -> None:
    with pytest.raises(InputError, match=unit):
        frame_of(cloud() * np.float32(factor))


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        (np.zeros((0, 3), np.float32), "zero points"),
        (np.full((5, 3), np.nan, np.float32), "none of them finite"),
        (np.zeros((5, 3), np.float32), "no return"),
    ],
)
def test_a_frame_without_points_is_refused(points: NDArray[Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        frame_of(points)
