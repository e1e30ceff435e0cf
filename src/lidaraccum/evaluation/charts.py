"""Line charts as inline SVG: what a report needs, without a plotting library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import isfinite, log10

from lidaraccum.errors import SettingsError

WIDTH, HEIGHT = 460, 300
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 26, 40
COLOURS = ("#1b6ca8", "#d1495b", "#2e8b57", "#edae49", "#6a4c93", "#7f7f7f", "#00798c", "#b56576")


@dataclass(frozen=True)
class Line:
    """One line of a chart; places that are not finite are left out."""

    name: str
    x: Sequence[float]
    y: Sequence[float]


@dataclass(frozen=True)
class Axes:
    """What a chart shows.

    Attributes:
        title: Above it.
        x_label: Under it.
        x_ticks: Where x is marked; its ends are the first and last.
        y_ticks: The same for y.
        log_x: Whether x is logarithmic.
    """

    title: str
    x_label: str
    x_ticks: Sequence[float]
    y_ticks: Sequence[float]
    log_x: bool = False

    def __post_init__(self) -> None:
        if len(self.x_ticks) < 2 or len(self.y_ticks) < 2:
            raise SettingsError("an axis needs two ticks at least")

    def across(self, x: float) -> float:
        """Place of x in the picture."""
        low, high, at = self.x_ticks[0], self.x_ticks[-1], x
        if self.log_x:
            low, high, at = log10(low), log10(high), log10(max(x, self.x_ticks[0]))
        return LEFT + (WIDTH - LEFT - RIGHT) * (at - low) / (high - low)

    def down(self, y: float) -> float:
        """Place of y in the picture."""
        low, high = self.y_ticks[0], self.y_ticks[-1]
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (min(y, high) - low) / (high - low)


def line_chart(axes: Axes, lines: Sequence[Line]) -> str:
    """An ``<svg>`` element with axes, lines and their names."""
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" role="img" '
        f'aria-label="{escape(axes.title)}">',
        f'<text x="{LEFT}" y="16" class="title">{escape(axes.title)}</text>',
        *_grid(axes),
    ]
    for number, line in enumerate(lines):
        colour = COLOURS[number % len(COLOURS)]
        shown = [(x, y) for x, y in zip(line.x, line.y, strict=True) if isfinite(x) and isfinite(y)]
        path = " ".join(f"{axes.across(x):.1f},{axes.down(y):.1f}" for x, y in shown)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts.append(
            f'<text x="{LEFT + 8}" y="{TOP + 14 + 14 * number}" '
            f'fill="{colour}">{escape(line.name)}</text>'
        )
    return "\n".join([*parts, "</svg>"])


def _grid(axes: Axes) -> list[str]:
    floor, ceiling = HEIGHT - BOTTOM, TOP
    parts = []
    for tick in axes.x_ticks:
        x = axes.across(tick)
        parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{floor}" y2="{ceiling}" stroke="#ddd"/>')
        parts.append(f'<text x="{x:.1f}" y="{floor + 14}" text-anchor="middle">{tick:g}</text>')
    for tick in axes.y_ticks:
        y = axes.down(tick)
        parts.append(
            f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>'
        )
        parts.append(f'<text x="{LEFT - 5}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    middle = (LEFT + WIDTH - RIGHT) / 2
    at = f'x="{middle:.0f}" y="{HEIGHT - 6}" text-anchor="middle"'
    parts.append(f"<text {at}>{escape(axes.x_label)}</text>")
    return parts


def round_ticks(largest: float, count: int = 5) -> list[float]:
    """Ticks from 0 to at least ``largest`` in round steps."""
    raw = max(largest, 1e-3) / count
    size = 10.0 ** int(log10(raw) // 1)
    step = next(size * factor for factor in (1, 2, 5, 10) if size * factor >= raw)
    return [step * number for number in range(count + 1)]
