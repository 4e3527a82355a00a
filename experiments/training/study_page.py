"""The page of the experiment: what a shield does at deployment and in training, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..markdown import MADE, line, table
from ..statistics import mean_interval, paired_difference
from .settings import SHIELDS

HEADS = (
    "shield", "collision term", "trainings", "games", "net captures", "captures", "against", "hits", "steps changed",
)  # fmt: skip
PAGE = "learning.md"


def learning_page(found: Sequence[Mapping[str, Any]], folder: Path) -> tuple[str, str, list[Path]]:
    """File name, text and pictures of the page."""
    lines = ["# Learning with a shield beside the reward", "", MADE, ""]
    for content in found:
        lines += _study(content)
    return PAGE, "\n".join(lines), []


def _study(content: Mapping[str, Any]) -> list[str]:
    settings, rows = content["settings"], content["rows"]
    training = settings["training"]
    lines = [
        f"{settings['seeds']} training(s) a cell of {training['decisions']:,} decisions of a boat, each held for "
        f"{training['interval']} game steps, on {line(training['preset'])}; then {settings['games']} games a cell and "
        "opponent from the same seeds. Means per game; net captures with 95 % bootstrap intervals over games (they say "
        "nothing of other trainings where there is one a cell). Hits are counted per boat, at the game's distance.",
        "",
    ]
    for opponent in dict.fromkeys(row["opponent"] for row in rows):
        mine = [row for row in rows if row["opponent"] == opponent]
        lines += [f"## Against {line(opponent)}", "", *table(HEADS, _rows(mine)), ""]
        lines += [*_price(mine), ""]
    return lines


def _rows(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    out = []
    for shield in SHIELDS:
        for collision in ("off", "on"):
            cell = [row for row in rows if row["shield"] == shield and row["collision"] == collision]
            if cell:
                out.append([shield, collision, *_figures(cell)])
    return out


def _figures(cell: Sequence[Mapping[str, Any]]) -> list[str]:
    nets = [net for row in cell for net in row["nets"]]
    interval = mean_interval(nets)
    limits = f" ({interval.low:+.2f} to {interval.high:+.2f})" if np.isfinite(interval.low) else ""

    def mean(name: str) -> str:
        return f"{np.mean([row[name] for row in cell]):.2f}"

    names = ("captures", "captures_against", "hits", "interventions")
    return [str(len(cell)), str(len(nets)), f"{np.mean(nets):+.2f}{limits}", *map(mean, names)]


def _price(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The same network without a shield and with one at deployment, game by game."""
    found = []
    for collision in ("off", "on"):
        off, on = ([n for r in rows if r["shield"] == s and r["collision"] == collision for n in r["nets"]]
                   for s in ("none", "deployment"))  # fmt: skip
        if len(off) == len(on) > 1:
            one = paired_difference(off, on)
            found.append(
                f"Shield at deployment less none, same network and starts, collision term {collision}: net captures "
                f"{one.value:+.2f} ({one.low:+.2f} to {one.high:+.2f}) a game."
            )
    return found
