"""Plots of the comparison page: guards against each other, or one guard in every family."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..encounters.summary import upper_bound
from ..report.plot_text import plot_text
from .comparison import NO_GUARD, Contest

COLOURS = {NO_GUARD: "#8a8a8a", "shield": "#1f6f8b"}
MARKS = ("o", "s", "^", "D")
OTHERS = ("#b5532a", "#6a4c93", "#2e7d32", "#c99700", "#ad1457", "#37474f")
OUTSIDE = OTHERS[0]
LEGEND_LETTER_IN, LEGEND_MARK_IN, LEGEND_LINE_IN = 0.06, 0.55, 0.17
"""Room in a legend of 8 points, inches: a letter, a mark with its gaps, a line."""
PANEL_IN, FAMILY_IN = (4.4, 3.6), 0.22
"""Width and least height of a panel, and room for a family's line, inches."""
SAME_PERCENT = (0.8, 0.02)
"""Markers nearer than this, changed and breached, cover each other."""
LINEAR_PERCENT = 0.1
"""Shares below it are drawn to scale, beyond it by their logarithm: 0 has a place."""


def plot_contests(contests: Sequence[Contest], path: Path) -> Path:
    """Draw one panel of each contest.

    Of several guards: share of encounters breached over share of commands changed. Of one guard: share breached in
    every family, and of the encounters that started outside the unavoidable set where the results tell. All with
    their one-sided 95 % upper limits.
    """
    from matplotlib.figure import Figure  # without pyplot: no window system is touched

    across = min(len(contests), 3)
    down = math.ceil(len(contests) / across)
    looks = looks_of(list(dict.fromkeys(guard for contest in contests for guard in contest.cells)))
    most_families = max(len(contest.families) if _alone(contest) else 0 for contest in contests)
    tall_in = max(PANEL_IN[1], 1.0 + FAMILY_IN * most_families)
    canvas = Figure(figsize=(PANEL_IN[0] * across, tall_in * down), layout="constrained", dpi=150)
    axes = canvas.subplots(down, across, squeeze=False).ravel()
    for axis, contest in zip(axes, contests, strict=False):
        (_draw_families if _alone(contest) else _draw_guards)(axis, contest, looks)
        _dress(axis, contest.title)
    _alike([axis for axis, contest in zip(axes, contests, strict=False) if _alone(contest)], most_families)
    for axis in axes[len(contests) :]:
        axis.set_visible(False)
    _legend(canvas, axes[: len(contests)])
    canvas.savefig(path)
    return path


def legend_columns(names: Sequence[str], width_in: float) -> int:
    """How many columns of these names fit beside each other, 1 to 4: of a wider legend the sides are cut off."""
    widest_in = LEGEND_MARK_IN + LEGEND_LETTER_IN * max((len(name) for name in names), default=0)
    return max(1, min(4, int(width_in / widest_in)))


def looks_of(guards: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Colour and mark of each guard; where colours run out they come again with another mark."""
    others = [guard for guard in guards if guard not in COLOURS]
    pairs = [(colour, mark) for mark in MARKS for colour in OTHERS]
    looks = {guard: pairs[k % len(pairs)] for k, guard in enumerate(others)}
    return {guard: looks.get(guard, (COLOURS.get(guard, ""), MARKS[0])) for guard in guards}


def _alone(contest: Contest) -> bool:
    return len(contest.cells) == 1


def _draw_guards(axis: Any, contest: Contest, looks: Mapping[str, tuple[str, str]]) -> None:
    order = [guard for guard in contest.totals if guard != "shield"]
    drawn: list[tuple[float, float]] = []
    for guard in [*(["shield"] if "shield" in contest.totals else []), *order]:
        one = contest.totals[guard]
        share, above = _share(one["breached"], one["encounters"])
        colour, mark = looks[guard]
        here = one["changed_percent"], share
        # guards that do the same show around each other: rings, the widest behind
        around = sum(_coincide(here, other) for other in drawn)
        drawn.append(here)
        axis.errorbar(*here, [[0.0], [above]], fmt=mark, markersize=5 + 4 * around, zorder=4 - 0.1 * around,
                      capsize=3 + 2 * around, color=colour, label=plot_text(guard),
                      markerfacecolor="none" if around else colour)  # fmt: skip
    axis.set_yscale("symlog", linthresh=LINEAR_PERCENT)
    axis.set_ylim(bottom=-0.02)
    axis.set_xlabel("commands changed, %", fontsize=8)
    axis.set_ylabel("encounters breached, %", fontsize=8)


def _coincide(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two markers would cover each other: shares of commands, and of encounters, in percent."""
    return abs(one[0] - other[0]) < SAME_PERCENT[0] and abs(one[1] - other[1]) < SAME_PERCENT[1]


def _draw_families(axis: Any, contest: Contest, looks: Mapping[str, tuple[str, str]]) -> None:
    ((guard, cells),) = contest.cells.items()
    colour, mark = looks[guard]
    every = [(cells[family]["breached"], cells[family]["encounters"]) for family in contest.families]
    _draw_shares(axis, every, -0.15, fmt=mark, color=colour, label=plot_text(guard))
    outside = [
        (cells[family].get("breaches_outside"), cells[family].get("started_outside")) for family in contest.families
    ]
    _draw_shares(
        axis, outside, 0.15, fmt="x", color=OUTSIDE, label=f"{plot_text(guard)}, started outside the unavoidable set"
    )
    axis.set_yticks(range(len(contest.families)), [plot_text(family) for family in contest.families])
    axis.set_xscale("symlog", linthresh=LINEAR_PERCENT)
    axis.set_xlim(left=-0.02)
    axis.set_xlabel("encounters breached, %", fontsize=8)


def _alike(axes: Sequence[Any], families: int) -> None:
    """Give panels of families one scale: as much room for each family, however few, and the same shares."""
    most = max((axis.get_xlim()[1] for axis in axes), default=1.0)
    for axis in axes:
        axis.set_ylim(families - 0.5, -0.5)
        axis.set_xlim(right=most)


def _draw_shares(axis: Any, counts: Sequence[tuple[int | None, int | None]], shift: float, **looks: Any) -> None:
    rows = [(k + shift, *_share(part, whole)) for k, (part, whole) in enumerate(counts) if part is not None and whole]
    if rows:
        heights, shares, above = zip(*rows, strict=True)
        axis.errorbar(shares, heights, xerr=[[0.0] * len(rows), above], markersize=4, capsize=2, **looks)


def _share(part: int, whole: int) -> tuple[float, float]:
    """Percentage, and how far above it the upper limit is."""
    share = 100.0 * part / whole
    return share, 100.0 * upper_bound(part, whole) - share


def _dress(axis: Any, title: str) -> None:
    axis.set_title(plot_text(title), fontsize=9)
    axis.tick_params(labelsize=8)
    axis.spines[["top", "right"]].set_visible(False)


def _legend(canvas: Any, axes: Sequence[Any]) -> None:
    """One legend of all panels below them, which are as much less high."""
    handles: dict[str, Any] = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    columns = legend_columns(list(handles), canvas.get_figwidth())
    canvas.set_figheight(canvas.get_figheight() + LEGEND_LINE_IN * math.ceil(len(handles) / columns))
    canvas.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=columns, frameon=False, fontsize=8
    )
