"""The clock gives each second to one stage."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from lidaraccum.pipeline import clock as clock_module
from lidaraccum.pipeline.clock import StageClock


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> StageClock:
    """A clock whose seconds pass only when the test says so."""
    made = StageClock()
    now = [100.0]
    monkeypatch.setattr(clock_module.time, "perf_counter", lambda: now[0])
    made.pass_seconds = lambda seconds: now.__setitem__(0, now[0] + seconds)  # type: ignore[attr-defined]
    return made


def test_an_inner_stage_is_not_counted_twice(clock: StageClock) -> None:
    with clock.stage("outer"):
        clock.pass_seconds(1)  # type: ignore[attr-defined]
        with clock.stage("inner"):
            clock.pass_seconds(5)  # type: ignore[attr-defined]
        clock.pass_seconds(2)  # type: ignore[attr-defined]
    clock.pass_seconds(50)  # type: ignore[attr-defined]
    assert clock.seconds == {"outer": 3, "inner": 5}


def test_a_pulled_generator_has_its_own_time(clock: StageClock) -> None:
    def read() -> Iterator[int]:
        for item in range(3):
            clock.pass_seconds(1)  # type: ignore[attr-defined]
            yield item

    def work(items: Iterator[int]) -> Iterator[int]:
        for item in items:
            clock.pass_seconds(10)  # type: ignore[attr-defined]
            yield item

    assert list(clock.timed("work", work(clock.timed("read", read())))) == [0, 1, 2]
    assert clock.seconds == {"read": 3, "work": 30}
