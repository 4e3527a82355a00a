"""What a value table looks like: its card as tables, its sets as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from steerclear.shield.exceptions import TableError
from steerclear.shield.tables.areas import HEADINGS_DEG, SPEED_SHARES, unsafe
from steerclear.shield.tables.card import Card
from steerclear.shield.tables.files import ValueTable

from .tables import titled

COLOURS = ("#b5532a", "#1f6f8b", "#7a8b1f", "#6f1f8b")
SHOWN_DEG = (0.0, 90.0, 180.0)


def show_card(console: Console, card: Card) -> None:
    """Print a card: what was solved, how well, and the sets' areas."""
    grid = card.make_grid()
    console.print(f"{card.own} with {card.other}, {card.other_may}; solved by version {card.version}")
    nodes = " x ".join(str(n) for n in grid.shape)
    console.print(f"grid {nodes}, ranges {grid.rho_first_m:g} to {grid.rho_last_m:g} m, step {card.dt_s:g} s")
    steps = f"{card.iterations} steps ({card.iterations * card.dt_s:g} s of play), last change {card.residual_m:.4f} m"
    console.print(f"{steps}; values up to {grid.cap_m:g} m")
    console.print("valid for an own boat at full thrust; at most this far apart under optimal play")
    heads = ["own/other m/s", *(f"{heading:g}°" for heading in HEADINGS_DEG)]
    for radius in map(_text, card.checked_radii_m):
        rows = [[name, *(f"{area:.1f}" for area in areas)] for name, areas in card.areas_m2[radius].items()]
        console.print()
        console.print(titled(f"Area, m², from which {radius} m cannot be kept, by relative heading", heads, rows))
        console.print(_verdict(card, radius))


def _text(radius_m: float) -> str:
    return f"{radius_m:g}"


def _verdict(card: Card, radius: str) -> str:
    change, margin = card.convergence[radius], card.margin[radius]
    ahead = card.areas_m2["reach_ahead_m"][radius]
    return (
        f"reaches {ahead:.1f} m ahead in a head-on; areas differ by {100 * change['mean']:.1f} % (at most "
        f"{100 * change['largest']:.1f} %) on a coarser grid; {margin['breaches']} of {margin['runs']} runs of the "
        f"full model breached, none begun {margin['margin_m']:.2f} m or more above the radius"
    )


def draw_sets(table: ValueTable, radii_m: tuple[float, ...], path: Path) -> Path:
    """Draw where each radius cannot be kept, in the own boat's frame, bow up; one panel a heading and speed pair.

    Args:
        table: the table.
        radii_m: separation radii, m.
        path: file to write; its ending chooses the kind.

    Raises:
        TableError: the file cannot be written.
    """
    from matplotlib.figure import Figure  # without pyplot: no window system is touched

    grid = table.card.make_grid()
    canvas = Figure(figsize=(3.4 * len(SHOWN_DEG), 3.4 * len(SPEED_SHARES)), layout="constrained", dpi=120)
    panels = canvas.subplots(len(SPEED_SHARES), len(SHOWN_DEG), squeeze=False)
    for row, (own, other) in zip(panels, SPEED_SHARES, strict=True):
        for axis, heading in zip(row, SHOWN_DEG, strict=True):
            speeds = own * grid.own_top_mps, other * grid.other_top_mps
            _draw_panel(axis, table, radii_m, heading, speeds)
    canvas.suptitle(f"{table.card.own} (bow up) with {table.card.other}, {table.card.other_may}")
    try:
        canvas.savefig(path)
    except (OSError, ValueError) as error:
        raise TableError(f"picture {path} cannot be written ({error}); give a .png or .svg file") from error
    return path


def _draw_panel(
    axis: Any, table: ValueTable, radii_m: tuple[float, ...], heading_deg: float, speeds: tuple[float, float]
) -> None:
    largest = max(radii_m)
    for colour, radius in zip(COLOURS, sorted(radii_m, reverse=True), strict=False):
        ranges, bearings, inside = unsafe(table, radius, heading_deg, *speeds)
        x, y = ranges[:, None] * np.sin(bearings), ranges[:, None] * np.cos(bearings)
        axis.contourf(x, y, inside.astype(float), [0.5, 1.5], colors=[colour], alpha=0.45)
        ring = np.linspace(0.0, 2.0 * np.pi, 181)
        axis.plot(radius * np.sin(ring), radius * np.cos(ring), color=colour, lw=0.8)
        if inside.any():
            largest = max(largest, float(ranges[inside.any(axis=1)].max()))
    axis.set(xlim=(-1.05 * largest, 1.05 * largest), ylim=(-1.05 * largest, 1.05 * largest), aspect="equal")
    axis.set_title(f"heading {heading_deg:g}°, {speeds[0]:g} / {speeds[1]:g} m/s", fontsize=9)
    axis.tick_params(labelsize=7)
