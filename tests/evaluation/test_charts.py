"""Charts are pictures that a browser can draw."""

from __future__ import annotations

from itertools import pairwise
from xml.etree import ElementTree

import pytest

from lidaraccum.errors import SettingsError
from lidaraccum.evaluation.charts import HEIGHT, WIDTH, Axes, Line, line_chart, round_ticks

AXES = Axes("a < b", "x", (0.01, 0.1, 1), (0, 0.5, 1), log_x=True)


def corners(svg: str) -> list[tuple[float, float]]:
    line = ElementTree.fromstring(svg).find("polyline")
    assert line is not None
    pairs = (pair.split(",") for pair in line.attrib["points"].split())
    return [(float(x), float(y)) for x, y in pairs]


def test_a_line_lies_in_the_picture_and_rises_where_its_values_do() -> None:
    places = corners(line_chart(AXES, [Line("one", (0.001, 0.1, 1), (0, 0.4, 7))]))
    assert all(0 <= x <= WIDTH and 0 <= y <= HEIGHT for x, y in places)
    assert [x for x, _ in places] == sorted(x for x, _ in places)
    assert [y for _, y in places] == sorted((y for _, y in places), reverse=True)


def test_what_is_not_finite_is_left_out() -> None:
    assert len(corners(line_chart(AXES, [Line("one", (0.1, 0.2), (float("nan"), 0.5))]))) == 1


@pytest.mark.parametrize("largest", [0.0, 0.3, 7.0, 178.4])
def test_ticks_reach_the_largest_value_in_equal_steps(largest: float) -> None:
    ticks = round_ticks(largest)
    assert ticks[0] == 0
    assert ticks[-1] >= largest
    assert all(b - a == pytest.approx(ticks[1]) for a, b in pairwise(ticks))


def test_an_axis_without_length_is_refused() -> None:
    with pytest.raises(SettingsError):
        Axes("", "", (1,), (0, 1))
