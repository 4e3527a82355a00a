"""Distribution plots as SVG text: for each distance, the share of encounters that came closer."""

from __future__ import annotations

from collections.abc import Sequence

from ..report.page import as_text
from ..report.svg import ticks

WIDTH, HEIGHT = 360, 190
LEFT, RIGHT, TOP, FOOT = 40, 12, 10, 40
MOST_M = 15.0
"""Distances beyond this are cut off: nobody is in danger there, m."""

Curve = tuple[str, str, Sequence[float]]
"""Class of the style sheet, name, and quantiles at equal steps of probability from 0 to 1."""


def distribution_plot(curves: Sequence[Curve], axis: str, reference_m: float) -> str:
    """Draw distribution functions.

    Args:
        curves: to draw, the last on top.
        axis: text below.
        reference_m: distance to mark.

    Returns:
        An ``svg`` element.
    """
    scale = [value for value in ticks(MOST_M, 5) if value <= MOST_M]
    lines = []
    for value in scale:
        lines.append(f'<line class="grid" x1="{_x(value):.1f}" x2="{_x(value):.1f}" y1="{TOP}" y2="{_y(0.0):.1f}"/>')
        lines.append(_text(_x(value), HEIGHT - FOOT + 13, f"{value:g}", "tick", "middle"))
    for share in (0.0, 0.5, 1.0):
        lines.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{_y(share):.1f}" y2="{_y(share):.1f}"/>')
        lines.append(_text(LEFT - 6, _y(share), f"{100 * share:g} %", "tick", "end"))
    lines.append(_text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 8, axis, "axis", "middle"))
    x = _x(reference_m)
    lines.append(f'<line class="reference" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - 6}" y2="{_y(0.0):.1f}"/>')
    lines += [_curve(*curve) for curve in curves]
    size = f'viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{as_text(axis)}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{"".join(lines)}</svg>'


def _curve(style: str, name: str, quantiles: Sequence[float]) -> str:
    """A curve through its quantiles, up to the plot's right edge."""
    steps = max(1, len(quantiles) - 1)
    points = [(min(value, MOST_M), k / steps) for k, value in enumerate(quantiles)]
    kept = [(value, share) for value, share in points if value < MOST_M]
    if len(kept) < len(points):
        kept.append((MOST_M, kept[-1][1] if kept else 0.0))
    else:
        kept.append((MOST_M, 1.0))
    path = " ".join(f"{_x(value):.1f},{_y(share):.1f}" for value, share in [(kept[0][0], 0.0), *kept])
    return f'<polyline class="curve {style}" points="{path}"><title>{as_text(name)}</title></polyline>'


def _x(value_m: float) -> float:
    return LEFT + value_m / MOST_M * (WIDTH - LEFT - RIGHT)


def _y(share: float) -> float:
    return TOP + (1.0 - share) * (HEIGHT - TOP - FOOT)


def _text(x: float, y: float, text: str, style: str, anchor: str) -> str:
    return f'<text class="{style}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" dy="0.35em">{as_text(text)}</text>'
