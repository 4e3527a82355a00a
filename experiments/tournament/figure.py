"""The figure that makes the point: net captures against collisions, an arrow per team from unshielded to shielded."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

from ..plots import COLOURS, text

Results = Mapping[str, Any]


def can_be_drawn(results: Results) -> bool:
    """Whether two states are there to draw arrows between."""
    return len([state for state in results["states"] if state["standings"]]) >= 2


def draw(results: Results, target: Path | BytesIO) -> None:
    """Draw the figure as PNG.

    Args:
        results: with two or more states; the first and the last are compared.
        target: file, or buffer.
    """
    from matplotlib.figure import Figure  # without pyplot: no window system is touched

    shown = [state for state in results["states"] if state["standings"]]
    before, after = ({line["team"]: line for line in state["standings"]} for state in (shown[0], shown[-1]))
    canvas = Figure(figsize=(7.5, 4.6), layout="constrained", dpi=150)
    axis = canvas.subplots()
    for number, team in enumerate(sorted(set(before) & set(after), key=lambda team: _place(before[team]))):
        _arrow(axis, team, before[team], after[team], number)
    axis.scatter([], [], color=COLOURS["off"], label="without shields")
    axis.scatter([], [], color=COLOURS["on"], label="shielded")
    axis.set_xlabel("collisions per double round robin")
    axis.set_ylabel("net captures per double round robin")
    axis.axhline(0.0, color="#999999", linewidth=0.7, zorder=0)
    axis.margins(x=0.09, y=0.12)
    axis.set_ylim(min(-1.0, axis.get_ylim()[0]), max(1.0, axis.get_ylim()[1]))  # no captures: no ticks of hundredths
    axis.set_xlim(left=min(-0.5, axis.get_xlim()[0]))
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)  # above: arrows go everywhere
    canvas.savefig(target, format="png")


def _place(line: Mapping[str, Any]) -> tuple[float, float]:
    """Height, then way to the right: teams whose labels could meet follow each other."""
    return float(line["net_captures"]), float(line["collisions"])


def _arrow(axis: Any, team: str, before: Mapping[str, Any], after: Mapping[str, Any], number: int) -> None:
    start, end = (line["collisions"] for line in (before, after)), (line["net_captures"] for line in (before, after))
    (x0, x1), (y0, y1) = start, end
    axis.annotate(
        "", (x1, y1), (x0, y0), arrowprops={"arrowstyle": "->", "color": "#555555", "shrinkA": 4, "shrinkB": 4}
    )
    axis.scatter([x0], [y0], color=COLOURS["off"], zorder=3)
    axis.scatter([x1], [y1], color=COLOURS["on"], zorder=3)
    # labels alternate above and below their dots
    axis.annotate(text(team), (x0, y0), (4, 7 if number % 2 == 0 else -13), textcoords="offset points", fontsize=9)
