"""Plots of reports (SVG that the page's style sheet colours) and of documentation pages (PNG).

Each function draws one figure; `svg` and `png` write it. Colours are names of the style sheet's variables, so that
plots follow a reader's dark or light page.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import escape
from steerclear.shield.foreign import visible

from .tables import number_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure
else:
    Figure = Any

WIDTH_IN = 4.2
"""Of a plot with names: its letters are legible on a phone, whose whole width it has, and not large elsewhere."""
COLOURS = {
    "off": "#94a3b8", "on": "#0b8a8f", "covered": "#3b6fd4", "ink": "#0f172a", "muted": "#546276", "line": "#d8dfe8",
    "mark": "#be1893", "r1": "#e2a100", "r2": "#e2641e", "r4": "#6d5bd0", "r5": "#7a4a1e", "card": "#fefefe",
}  # fmt: skip
"""By name of the variable in ``report.css`` (its light page's values)."""
SERIES = tuple(
    f"{colour} {pattern}".strip()
    for pattern in ("", "striped", "dotted")
    for colour in ("on", "r1", "r2", "mark", "r4", "r5")
)
"""Looks of parts and curves, in turn: a colour and, when all of these are used, a pattern; no two are alike."""
PATTERNS = {"": ("", "-"), "striped": ("||||", "--"), "dotted": ("....", ":")}
"""Hatch of an area and dash of a line, by pattern."""
HUES = tuple(f"tab:{name}" for name in ("blue", "orange", "green", "red", "purple", "brown", "pink", "olive", "cyan"))
"""Colours of names in a scatter, in turn."""
LABEL_LETTERS, LABEL_END = 22, 13
WORDS_LETTERS, MOST_TICKS = 40, 5
NAMED = "whole name: "
"""Begins the id of a label of which the whole name is to be seen by pointing at it."""
MOST_DOTS = 600
Labelled = Sequence[tuple[str, Sequence[tuple[str, Mapping[str, Any]]]]]
"""Groups: label, and per state its name and figure (value, low, high)."""


@cache
def _prepared() -> None:
    import matplotlib as mpl

    mpl.rcParams.update(
        {"svg.fonttype": "none", "svg.hashsalt": "steerclear", "font.size": 9, "text.parse_math": False}
    )


def _canvas(height_in: float, columns: int = 1, width_in: float = WIDTH_IN, rows: int = 1) -> tuple[Figure, Any]:
    """A figure and its axes; without pyplot, so that no window system is touched."""
    _prepared()
    from matplotlib.figure import Figure

    canvas = Figure(figsize=(width_in, height_in), layout="constrained")
    canvas.patch.set_alpha(0.0)
    axes = canvas.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes:
        axis.patch.set_alpha(0.0)
        axis.spines[["top", "right"]].set_visible(False)
        axis.spines[["left", "bottom"]].set_color(COLOURS["line"])
        axis.tick_params(colors=COLOURS["muted"], labelcolor=COLOURS["muted"])
        axis.set_axisbelow(True)
    return canvas, axes if len(axes) > 1 else axes[0]


def text(words: object) -> str:
    """Text that a plot shows as it is."""
    return visible(words)


def label(words: str) -> str:
    """A group's label: files without their folders; its middle is left out when there is no room for it."""
    words = text(" vs ".join(Path(part).name or part for part in words.split(" vs ")))
    if len(words) <= LABEL_LETTERS:
        return words
    return f"{words[: LABEL_LETTERS - LABEL_END - 1]}…{words[-LABEL_END:]}"


def bars(groups: Labelled, axis_words: str) -> Figure:
    """Draw groups of bars (a state is a colour's name) with their intervals."""
    lines = sum(len(group) for _, group in groups)
    canvas, axis = _canvas(0.9 + 0.21 * lines + 0.12 * len(groups))
    y, places = 0.0, []
    for _, group in groups:
        places.append(y + (len(group) - 1) / 2.0)
        for state, figure in group:
            _bar(axis, y, COLOURS[state], figure)
            y += 1.0
        y += 0.6
    _ended(axis, places, [name for name, _ in groups], axis_words)
    return canvas


def _look(look: str) -> tuple[str, str, str]:
    """Colour, hatch and dash of one of `SERIES`."""
    colour, _, pattern = look.partition(" ")
    return COLOURS[colour], *PATTERNS[pattern]


def _bar(axis: Any, y: float, colour: str, figure: Mapping[str, Any]) -> None:
    value, low, high = (figure.get(name) for name in ("value", "low", "high"))
    if value is None or value != value:
        axis.text(0.0, y, " -", va="center", color=COLOURS["ink"])
        return
    axis.barh(y, value, 0.82, color=colour)
    end = value
    if low is not None and high is not None and low == low and high == high:
        axis.errorbar(
            [value], [y], xerr=[[value - low], [high - value]], fmt="none", ecolor=COLOURS["ink"], capsize=2.5
        )
        end = max(value, high)
    axis.annotate(number_text(value), (end, y), (4, 0), textcoords="offset points", va="center", color=COLOURS["ink"])


def dots(
    groups: Sequence[tuple[str, Sequence[tuple[str, Sequence[float]]]]], axis_words: str, reference: float | None = None
) -> Figure:
    """Draw values as dots, those alike on top of each other: per group its label and, per state, name and values."""
    rows = [(name, state, values) for name, group in groups for state, values in group]
    most = max([*(v for *_, values in rows for v in values), reference or 0.0, 1e-9])
    each = max(1, math.ceil(max((len(values) for *_, values in rows), default=0) / MOST_DOTS))
    stacks = [_stacks(values[::each], most) for *_, values in rows]
    heights = [max((y for _, y in stack), default=0) + 2.0 for stack in stacks]
    canvas, axis = _canvas(1.0 + 0.1 * sum(heights))
    floor, middles = 0.0, dict[str, list[float]]()
    for (name, state, _), stack, height in zip(rows, stacks, heights, strict=True):
        floor -= height
        middles.setdefault(name, []).append(floor + height / 2.0)
        if stack:
            axis.plot(*np.array([(x, floor + y) for x, y in stack]).T, "o", ms=4.6, color=COLOURS[state], mew=0)
        axis.axhline(floor - 0.6, color=COLOURS["line"], lw=0.7)
    words = axis_words if each == 1 else f"{axis_words}\n(one of {each} shown)"
    places = [-float(np.mean(values)) for values in middles.values()]
    axis.set_ylim(floor - 1.0, 0.5)
    _ended(axis, [-p for p in places], [*middles], words, reference, turned=False)
    return canvas


def _stacks(values: Sequence[float], most: float) -> list[tuple[float, int]]:
    columns = dict[int, int]()
    found = []
    for value in sorted(values):
        column = round(value / most * 90)
        found.append((value, columns.get(column, 0)))
        columns[column] = columns.get(column, 0) + 1
    return found


def shares(groups: Sequence[tuple[str, Sequence[tuple[str, float]]]], axis_words: str) -> Figure:
    """Draw one bar per group, made of its parts (name and percent), which come in the same order everywhere."""
    canvas, axis = _canvas(0.9 + 0.34 * len(groups))
    for y, (_, parts) in enumerate(groups):
        left = 0.0
        for look, (_, percent) in zip(SERIES, parts, strict=False):
            colour, hatch, _ = _look(look)
            axis.barh(y, percent, 0.6, left=left, color=colour, hatch=hatch, edgecolor=COLOURS["card"], lw=0.0)
            left += percent
        axis.annotate(f"{left:.2f} %", (left, y), (4, 0), textcoords="offset points", va="center", color=COLOURS["ink"])
    _ended(axis, list(range(len(groups))), [name for name, _ in groups], axis_words)
    return canvas


def _ended(
    axis: Any,
    places: Sequence[float],
    names: Sequence[str],
    words: str,
    reference: float | None = None,
    turned: bool = True,
) -> None:
    axis.set_yticks(places, [label(name) for name in names])
    for shown, name in zip(axis.get_yticklabels(), names, strict=True):
        shown.set_gid(f"{NAMED}{text(name)}")
    axis.tick_params(axis="y", length=0, labelcolor=COLOURS["ink"])
    axis.locator_params(axis="x", nbins=MOST_TICKS)
    axis.set_xlabel(
        "\n".join(line for part in words.split("\n") for line in wrap(part, WORDS_LETTERS)), color=COLOURS["muted"]
    )
    axis.grid(axis="x", color=COLOURS["line"], lw=0.8)
    if reference is not None:
        axis.axvline(reference, color=COLOURS["mark"], ls="--", lw=1.3)
    low, high = axis.get_xlim()
    axis.set_xlim(left=min(0.0, low) if axis.dataLim.x1 > 0.0 else 0.0, right=high * 1.08)  # not below 0 where all is 0
    if turned:
        axis.invert_yaxis()


def curves(series: Sequence[tuple[str, str, Sequence[float], Sequence[float]]], reference: float, words: str) -> Figure:
    """Draw distributions, share of all below a value: name, look, values, shares (0 to 1)."""
    canvas, axis = _canvas(2.0, width_in=3.6)
    for _, look, x, y in series:
        colour, _, dash = _look(look)
        axis.plot(x, y, color=colour, ls=dash, lw=1.5)
    axis.axvline(reference, color=COLOURS["mark"], ls="--", lw=1.1)
    axis.grid(color=COLOURS["line"], lw=0.6)
    axis.set_xlabel(words, color=COLOURS["muted"])
    axis.set_ylim(0.0, 1.0)
    axis.set_xlim(left=0.0)
    return canvas


def off_on(groups: Sequence[Mapping[str, Any]], metrics: Sequence[tuple[str, str]]) -> Figure:
    """Draw metrics (key and title) of all pairings (of `ablation.pairings_of`) off and on, side by side."""
    canvas, axes = _canvas(3.2, max(len(metrics), 2), 4.0 * max(len(metrics), 2))
    for axis, (key, title) in zip(axes, metrics, strict=False):
        figures = [pairing["metrics"][key] for pairing in groups]
        states = ["off", "on", *(["covered"] if any("covered" in figure for figure in figures) else [])]
        for k, state in enumerate(states):
            shift = (k - (len(states) - 1) / 2) * 0.72 / len(states)
            shown = [(x + shift, figure[state]) for x, figure in enumerate(figures) if state in figure]
            values = np.array([(f["value"], f["low"], f["high"]) for _, f in shown], dtype=np.float64).reshape(-1, 3)
            spread = np.nan_to_num(np.abs(values[:, [1, 2]] - values[:, [0]]).T)
            places = [x for x, _ in shown]
            axis.bar(places, values[:, 0], 0.68 / len(states), color=COLOURS[state], label=f"shield {state}")
            axis.errorbar(places, values[:, 0], spread, fmt="none", ecolor=COLOURS["ink"], capsize=3)
        names = [text(pairing["pairing"].replace(" vs ", "\nvs ")) for pairing in groups]
        axis.set_xticks(np.arange(len(groups)), names, color=COLOURS["ink"])
        axis.set_title(title, fontsize=9)
    axes[0].legend(frameon=False)
    return canvas


def scatter(
    panels: Sequence[tuple[str, Sequence[tuple[str, float, float, float]]]], words: tuple[str, str], lines: bool = False
) -> Figure:
    """Draw panels of points (name, x, y, upper limit of y); a name looks the same in all; ``lines`` join its points."""
    across = min(len(panels), 3)
    down = math.ceil(len(panels) / across)
    canvas, axes = _canvas(3.4 * down + 0.4, across, 4.2 * across, down)
    names = list(dict.fromkeys(name for _, points in panels for name, *_ in points))
    looks = {name: (HUES[k % len(HUES)], "osD^vP*"[k // len(HUES) % 7]) for k, name in enumerate(names)}
    for axis, (title, points) in zip(np.ravel(axes), panels, strict=False):
        for name in names:
            chosen = np.array([point[1:] for point in points if point[0] == name], dtype=np.float64).reshape(-1, 3)
            if len(chosen):
                colour, mark = looks[name]
                above = np.maximum(np.nan_to_num(chosen[:, 2] - chosen[:, 1]), 0.0)
                axis.errorbar(
                    chosen[:, 0], chosen[:, 1], [np.zeros(len(above)), above], fmt=mark + "-" * lines, color=colour,
                    ms=5, lw=0.8, capsize=3, label=text(name),
                )  # fmt: skip
        axis.set_title(text(title), fontsize=9)
        axis.set_xlabel(words[0])
        axis.set_ylabel(words[1])
    for axis in np.ravel(axes)[len(panels) :]:
        axis.set_visible(False)
    handles = {h.get_label(): h for axis in np.ravel(axes)[: len(panels)] for h in axis.get_legend_handles_labels()[0]}
    widest = max((len(name) for name in handles), default=1)
    columns = max(1, min(4, int(4.2 * across / (0.55 + 0.06 * widest))))
    canvas.set_figheight(canvas.get_figheight() + 0.2 * math.ceil(len(handles) / columns))
    canvas.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=columns, fontsize=8, frameon=False
    )
    return canvas


def svg(figure: Figure, words: str) -> str:
    """The figure as an ``svg`` element whose colours are the page's; ``words`` for who cannot see it."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    content = buffer.getvalue()
    content = re.sub(r"<metadata>.*?</metadata>", "", content[content.index("<svg") :], flags=re.DOTALL)
    content = re.sub(r'(<svg[^>]*?) width="[^"]*"|(<svg[^>]*?) height="[^"]*"', r"\1\2", content, count=0)
    content = re.sub(f'<g id="{NAMED}([^"]*)">', r"<g><title>\1</title>", content)
    content = content.replace("#1f77b4", COLOURS["ink"])  # of marks that were given no fill: they have no area
    for name, colour in COLOURS.items():
        content = content.replace(colour, f"var(--{name})")
    return content.replace("<svg", f'<svg role="img" aria-label="{escape(words)}"', 1)


def png(figure: Figure, path: Path) -> Path:
    """Write the figure as a picture on white."""
    figure.savefig(path, dpi=150, facecolor="white", metadata={"Software": None})
    return path
