"""Plots of the documentation pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .plot_text import plot_text

COLOURS = {"off": "#b5532a", "on": "#1f6f8b"}


def plot_off_on(pairings: Sequence[Mapping[str, Any]], figures: Sequence[tuple[str, str]], path: Path) -> Path:
    """Draw figures of all pairings without and with the shield, side by side, with their intervals.

    Args:
        pairings: summaries of pairings.
        figures: name and title of each figure.
        path: PNG file to write.
    """
    from matplotlib.figure import Figure  # without pyplot: no window system is touched

    canvas = Figure(figsize=(4.0 * len(figures), 3.2), layout="constrained", dpi=150)
    axes = canvas.subplots(1, len(figures), squeeze=False)[0]
    for axis, (name, title) in zip(axes, figures, strict=True):
        _draw(axis, [pairing["metrics"][name] for pairing in pairings], title)
        names = [plot_text(pairing["pairing"].replace(" vs ", "\nvs ")) for pairing in pairings]
        axis.set_xticks(np.arange(len(pairings)), names)
    axes[0].legend(frameon=False)
    canvas.savefig(path)
    return path


def _draw(axis: Any, figures: Sequence[Mapping[str, Any]], title: str) -> None:
    for shift, state in ((-0.18, "off"), (0.18, "on")):
        shown = [(x + shift, figure[state]) for x, figure in enumerate(figures) if state in figure]
        values = np.array([(f["value"], f["low"], f["high"]) for _, f in shown], dtype=np.float64).reshape(-1, 3)
        spread = np.abs(values[:, [1, 2]] - values[:, [0]]).T
        places = [x for x, _ in shown]
        axis.bar(places, values[:, 0], 0.34, color=COLOURS[state], label=f"shield {state}")
        axis.errorbar(places, values[:, 0], np.nan_to_num(spread), fmt="none", ecolor="#333333", capsize=3)
    axis.set_title(title, fontsize=9)
    axis.tick_params(labelsize=8)
    axis.spines[["top", "right"]].set_visible(False)
