"""Flow by part: the parts are disjoint, and every group is a sum of them."""

from __future__ import annotations

from math import isnan

import numpy as np
import pytest

from lidaraccum.errors import InputError
from lidaraccum.metrics.flow import FlowErrors
from lidaraccum.metrics.flow_parts import FlowByPart, summarise_by_part

EPE = np.array([0.01, 0.02, 0.03, 0.40, 0.60, 0.90])
DYNAMIC = np.array([False, False, False, True, True, True])
FOREGROUND = np.array([False, False, True, True, True, False])


def example() -> FlowByPart:
    return summarise_by_part(FlowErrors(EPE, np.ones(6)), DYNAMIC, FOREGROUND)


def test_hand_computed_parts() -> None:
    parts = example()
    assert parts.static.epe_mean == pytest.approx(0.02)
    assert parts.static_foreground.epe_mean == pytest.approx(0.03)
    assert parts.static_background.epe_mean == pytest.approx(0.015)
    assert parts.dynamic.epe_mean == pytest.approx(1.9 / 3)
    assert parts.everything.epe_mean == pytest.approx(EPE.mean())
    counts = (parts.static.points, parts.dynamic.points, parts.everything.points)
    assert counts == (3, 3, 6)


def test_hand_computed_three_way_epe() -> None:
    three = example().three_way
    assert three.foreground_dynamic == pytest.approx(0.5)
    assert three.foreground_static == pytest.approx(0.03)
    assert three.background_static == pytest.approx(0.015)
    assert three.mean == pytest.approx(0.545 / 3)


def test_a_window_without_movers_leaves_the_dynamic_scores_undefined() -> None:
    nothing = np.zeros(6, dtype=bool)
    parts = summarise_by_part(FlowErrors(EPE, np.ones(6)), nothing, FOREGROUND)
    assert parts.dynamic.points == 0
    assert isnan(parts.dynamic.epe_mean)
    assert isnan(parts.dynamic.epe_median)
    assert isnan(parts.three_way.mean)
    assert parts.static.points == 6


def test_pooled_windows_are_summed_part_by_part() -> None:
    pooled = FlowByPart.pool([example(), example()])
    assert pooled.dynamic.points == 6
    assert pooled.dynamic.epe_mean == pytest.approx(example().dynamic.epe_mean)
    assert pooled.three_way.mean == pytest.approx(example().three_way.mean)
    assert FlowByPart.pool(()).everything.points == 0


def test_masks_that_do_not_fit_are_refused() -> None:
    errors = FlowErrors(EPE, np.ones(6))
    with pytest.raises(InputError, match="dynamic"):
        summarise_by_part(errors, DYNAMIC[:5], FOREGROUND)
    with pytest.raises(InputError, match="foreground"):
        summarise_by_part(errors, DYNAMIC, FOREGROUND.astype(np.int64))
