"""Small plots as SVG text that a page's style sheet colours (classes ``off``, ``on``, ``muted`` and the like)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from .page import as_text

WIDTH = 600
LEFT, RIGHT, TOP, FOOT = 146, 62, 8, 40
LABEL_LETTERS = 20
BAR, GAP, GROUP_GAP = 15, 4, 16
DOT = 3.2


@dataclass(frozen=True)
class Bar:
    """One bar.

    Attributes:
        style: Class of the style sheet.
        value: Length; None draws no bar.
        low: Lower limit, None where there is none.
        high: Upper limit, None where there is none.
        text: Written after it.
    """

    style: str
    value: float | None
    low: float | None
    high: float | None
    text: str


def ticks(high: float, wanted: int = 6) -> list[float]:
    """Return round numbers from 0 to the first one not below ``high``."""
    if not high > 0.0:
        return [0.0, 1.0]
    rough = high / wanted
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(size * factor for factor in (1.0, 2.0, 2.5, 5.0, 10.0) if size * factor >= rough)
    return [step * k for k in range(math.ceil(high / step - 1e-9) + 1)]


def bar_plot(groups: Sequence[tuple[str, Sequence[Bar]]], axis: str, reference: float | None = None) -> str:
    """Draw groups of bars with their intervals.

    Args:
        groups: Label and bars of each group, from top to bottom.
        axis: Text of the axis.
        reference: A value to mark with a line.

    Returns:
        An ``svg`` element.
    """
    bars = [bar for _, group in groups for bar in group]
    reach = [value for bar in bars for value in (bar.value, bar.high) if value is not None]
    scale = ticks(max([*reach, reference or 0.0], default=0.0))
    parts, y = [], float(TOP)
    for label, group in groups:
        height = len(group) * (BAR + GAP) - GAP
        parts.append(_label(y + height / 2, label))
        for bar in group:
            parts += _bar(bar, y, scale[-1])
            y += BAR + GAP
        y += GROUP_GAP - GAP
    return _plot(parts, y, scale, axis, reference)


def dot_plot(
    groups: Sequence[tuple[str, Sequence[tuple[str, Sequence[float]]]]], axis: str, reference: float | None = None
) -> str:
    """Draw every value as a dot, equal ones on top of each other.

    Args:
        groups: Label and, per row, class and values, from top to bottom.
        axis: Text of the axis.
        reference: A value to mark with a line.

    Returns:
        An ``svg`` element.
    """
    values = [value for _, rows in groups for _, row in rows for value in row]
    scale = ticks(max([*values, reference or 0.0], default=0.0))
    parts, y = [], float(TOP)
    for label, rows in groups:
        first = y
        for style, row in rows:
            columns = _columns(row, scale[-1])
            y += max((len(column) for column in columns.values()), default=1) * 2 * DOT + 6
            for column in columns.values():
                parts += [
                    _dot(_at(value, scale[-1]), y - DOT - 2 * DOT * k, style, value) for k, value in enumerate(column)
                ]
            parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(_label((first + y) / 2, label))
        y += GROUP_GAP
    return _plot(parts, y, scale, axis, reference)


def share_plot(groups: Sequence[tuple[str, Sequence[tuple[str, str, float]]]], axis: str) -> str:
    """Draw one bar per group, made of its parts.

    Args:
        groups: Label and, per part, class, name and percent, from top to bottom.
        axis: Text of the axis.

    Returns:
        An ``svg`` element.
    """
    scale = ticks(max((sum(part[2] for part in group) for _, group in groups), default=0.0))
    parts, y = [], float(TOP)
    for label, group in groups:
        parts.append(_label(y + BAR / 2, label))
        x = float(LEFT)
        for style, name, percent in group:
            wide = percent / scale[-1] * _span()
            title = f"<title>{as_text(name)}: {percent:.2f} %</title>"
            parts.append(
                f'<rect class="{style}" x="{x:.1f}" y="{y:.1f}" width="{wide:.1f}" height="{BAR}">{title}</rect>'
            )
            x += wide
        parts.append(_text(x + 6, y + BAR / 2, f"{sum(part[2] for part in group):.2f} %", "value", "start"))
        y += BAR + GROUP_GAP
    return _plot(parts, y, scale, axis, None)


def _span() -> float:
    return float(WIDTH - LEFT - RIGHT)


def _at(value: float, most: float) -> float:
    return LEFT + value / most * _span()


def _text(x: float, y: float, text: str, style: str, anchor: str) -> str:
    return f'<text class="{style}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" dy="0.35em">{as_text(text)}</text>'


def _label(y: float, text: str) -> str:
    """Write a group's label, its beginning left out when there is no room for it."""
    shown = text if len(text) <= LABEL_LETTERS else "…" + text[1 - LABEL_LETTERS :]
    return f"<g>{_text(LEFT - 10, y, shown, 'label', 'end')}<title>{as_text(text)}</title></g>"


def _bar(bar: Bar, y: float, most: float) -> list[str]:
    middle = y + BAR / 2
    if bar.value is None:
        return [_text(LEFT + 6, middle, bar.text, "value", "start")]
    wide = max(bar.value / most * _span(), 1.0)
    parts = [f'<rect class="{bar.style}" x="{LEFT}" y="{y:.1f}" width="{wide:.1f}" height="{BAR}" rx="2"/>']
    end = LEFT + wide
    if bar.low is not None and bar.high is not None:
        low, high = _at(max(bar.low, 0.0), most), _at(bar.high, most)
        cap = f"M{low:.1f} {middle - 4:.1f}v8M{high:.1f} {middle - 4:.1f}v8M{low:.1f} {middle:.1f}H{high:.1f}"
        parts.append(f'<path class="limits" d="{cap}"/>')
        end = max(end, high)
    return [*parts, _text(end + 6, middle, bar.text, "value", "start")]


def _columns(values: Sequence[float], most: float) -> dict[int, list[float]]:
    """Group values whose dots would lie on each other."""
    columns: dict[int, list[float]] = {}
    for value in sorted(values):
        columns.setdefault(round((_at(value, most) - LEFT) / (2 * DOT)), []).append(value)
    return columns


def _dot(x: float, y: float, style: str, value: float) -> str:
    return f'<circle class="{style}" cx="{x:.1f}" cy="{y:.1f}" r="{DOT - 0.4}"><title>{value:.2f}</title></circle>'


def _plot(parts: Sequence[str], height: float, scale: Sequence[float], axis: str, reference: float | None) -> str:
    foot = height - GROUP_GAP + 8
    lines = []
    for value in scale:
        x = _at(value, scale[-1])
        lines.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - 4}" y2="{foot:.1f}"/>')
        lines.append(_text(x, foot + 11, f"{value:g}", "tick", "middle"))
    lines.append(_text(LEFT + _span() / 2, foot + 28, axis, "axis", "middle"))
    mark = []
    if reference is not None:
        x = _at(reference, scale[-1])
        mark.append(f'<line class="reference" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - 6}" y2="{foot:.1f}"/>')
    size = f'viewBox="0 0 {WIDTH} {foot + FOOT:.0f}" role="img" aria-label="{as_text(axis)}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{"".join([*lines, *parts, *mark])}</svg>'
