"""What a value table looks like: its card as tables, its sets as a picture."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from steerclear.shield.exceptions import TableError
from steerclear.shield.tables.areas import HEADINGS_DEG, SPEED_SHARES, unsafe
from steerclear.shield.tables.card import Card
from steerclear.shield.tables.files import ValueTable
from steerclear.shield.tables.make import COARSER

from ..markdown import MADE, line, table
from ..plots import text as plot_text
from ..result_files import make_folder_of
from ..tables import titled

COLOURS = ("#e3bfae", "#a5c5d1", "#c5cba0", "#c6a8d1")
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
    for radius in (f"{radius:g}" for radius in card.checked_radii_m):
        rows = _areas(card, radius)
        console.print()
        console.print(titled(f"Area, m², from which {radius} m cannot be kept, by relative heading", heads, rows))
    console.print()
    console.print(
        titled("What the table is worth", ["", *(f"{radius:g} m" for radius in card.checked_radii_m)], worth(card))
    )


def worth(card: Card) -> list[list[str]]:
    """Rows of a card's figures: reach, convergence, margin by radius, then the error of the reduced model."""
    columns = [_worth_of(card, f"{radius:g}") for radius in card.checked_radii_m]
    return [[name, *(column[name] for column in columns)] for name in (columns[0] if columns else ())]


def _worth_of(card: Card, radius: str) -> dict[str, str]:
    change, margin = card.convergence[radius], card.margin[radius]
    return {
        "reach ahead in a head-on, m": f"{card.areas_m2['reach_ahead_m'][radius]:.1f}",
        f"change of areas on a grid {COARSER:g} times coarser, mean": f"{100 * change['mean']:.1f} %",
        "the same, largest": f"{100 * change['largest']:.1f} %",
        "runs of the full model": f"{margin['runs']:,}",
        "of these breached": f"{margin['breaches']:,}",
        "deepest breach, m": f"{margin['depth_m']:.2f}",
        "margin on the value from which none did, m": f"{margin['margin_m']:.2f}",
    }


def tables_page(cards: Sequence[str]) -> str:
    """Write the page of value tables from their cards.

    Args:
        cards: as JSON.

    Raises:
        TableError: one is no card.
    """
    lines = ["# Value tables: figures", "", MADE, "", "What the words mean: [tables.md](tables.md).", ""]
    for card in map(Card.of_json, cards):
        radii = [f"{radius:g}" for radius in card.checked_radii_m]
        lines += [f"## {line(f'{card.own} with {card.other}, {card.other_may}')}", "", _made_how(card), ""]
        lines += [*table(["", *(f"{radius} m" for radius in radii)], worth(card)), "", _model_errors(card), ""]
        for radius in radii:
            lines += [f"Areas, m², from which {radius} m cannot be kept, by speeds and relative heading:", ""]
            lines += [
                *table(["own/other m/s", *(f"{heading:g}°" for heading in HEADINGS_DEG)], _areas(card, radius)),
                "",
            ]
    return "\n".join(lines)


def _areas(card: Card, radius: str) -> list[list[str]]:
    return [[name, *(f"{area:.1f}" for area in areas)] for name, areas in card.areas_m2[radius].items()]


def _made_how(card: Card) -> str:
    grid = card.make_grid()
    nodes = " x ".join(str(n) for n in grid.shape)
    return (
        f"Grid {nodes}, ranges {grid.rho_first_m:g} to {grid.rho_last_m:g} m, step {card.dt_s:g} s, "
        f"{card.iterations} steps of at most {card.horizon_s / card.dt_s:.0f}, last change {card.residual_m:.4f} m."
    )


def _model_errors(card: Card) -> str:
    parts = [
        f"{getattr(card, role)} {error['place_m_p99']:.3f} m, {error['speed_mps_p99']:.3f} m/s"
        for role, error in card.model_error.items()
    ]
    return f"Error of the reduced model over one step, 99th percentile: {'; '.join(dict.fromkeys(parts))}."


def draw_sets(values: ValueTable, radii_m: tuple[float, ...], path: Path) -> Path:
    """Draw where each radius cannot be kept, in the own boat's frame, bow up; one panel a heading and speed pair.

    Args:
        values: the table.
        radii_m: separation radii, m.
        path: file to write; its ending chooses the kind.

    Raises:
        TableError: the file cannot be written.
    """
    from matplotlib.figure import Figure  # without pyplot: no window system is touched

    grid = values.card.make_grid()
    canvas = Figure(figsize=(3.4 * len(SHOWN_DEG), 3.4 * len(SPEED_SHARES)), layout="constrained", dpi=120)
    panels = canvas.subplots(len(SPEED_SHARES), len(SHOWN_DEG), squeeze=False)
    farthest = max(radii_m)
    for row, (own, other) in zip(panels, SPEED_SHARES, strict=True):
        for axis, heading in zip(row, SHOWN_DEG, strict=True):
            speeds = own * grid.own_top_mps, other * grid.other_top_mps
            farthest = max(farthest, _draw_panel(axis, values, radii_m, heading, speeds))
    for axis in panels.flat:
        axis.set(xlim=(-1.1 * farthest, 1.1 * farthest), ylim=(-1.1 * farthest, 1.1 * farthest))
    panels.flat[0].legend(fontsize=6, loc="upper left")
    title = f"{values.card.own} (bow up) with {values.card.other}, {values.card.other_may}"
    canvas.suptitle(f"{plot_text(title)}: where the other boat must not be, m")
    try:
        make_folder_of(path)
        canvas.savefig(path)
    except (OSError, ValueError) as error:
        raise TableError(f"picture {path} cannot be written ({error}); give a .png or .svg file") from error
    return path


def check_picture(path: Path | None) -> None:
    """Refuse a picture of a kind that cannot be drawn, before anything is.

    Raises:
        TableError: its ending is another than .png or .svg.
    """
    if path is not None and path.suffix.lower() not in (".png", ".svg"):
        raise TableError(f"--picture {path} does not end in .png or .svg; give a name that does")


def _draw_panel(
    axis: Any, values: ValueTable, radii_m: tuple[float, ...], heading_deg: float, speeds: tuple[float, float]
) -> float:
    """Draw one panel; returns how far its sets reach, m."""
    ring, farthest = np.linspace(0.0, 2.0 * np.pi, 181), 0.0
    for colour, radius in zip(itertools.cycle(COLOURS), sorted(radii_m, reverse=True)):
        ranges, bearings, inside = unsafe(values, radius, heading_deg, *speeds)
        x, y = ranges[:, None] * np.sin(bearings), ranges[:, None] * np.cos(bearings)
        axis.contourf(x, y, inside.astype(float), [0.5, 1.5], colors=[colour])
        axis.plot(radius * np.sin(ring), radius * np.cos(ring), color="black", lw=0.8, ls=":")
        farthest = max(farthest, float(ranges[inside.any(axis=1)].max(initial=0.0)))
        axis.fill([], [], color=colour, label=f"{radius:g} m cannot be kept")
    axis.plot(0.0, 0.0, marker=(3, 0, 0.0), color="black", ms=7)
    axis.plot(0.9, 0.1, marker=(3, 0, -heading_deg), color="black", mfc="white", ms=7, transform=axis.transAxes)
    axis.set_aspect("equal")
    axis.set_title(f"other heads {heading_deg:g}°, {speeds[0]:g} / {speeds[1]:g} m/s", fontsize=9)
    axis.tick_params(labelsize=7)
    return farthest
