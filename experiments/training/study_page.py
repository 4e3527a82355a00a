"""The page of the experiment: what a shield does at deployment and in training, with intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..markdown import MADE, line, table
from ..statistics import (
    Interval,
    count_difference,
    count_interval,
    mean_interval,
    paired_difference,
    student_interval,
)
from .config import SHIELDS

HEADS = (
    "shield", "collision term", "net captures", "of each training", "captures", "against", "hits", "steps changed",
)  # fmt: skip
LEARNING = ("shield in training", "collision term", "1st quarter", "2nd", "3rd", "4th", "hits")
CHANGES = ("change", "net captures", "hits")
PAGE = "learning.md"
Rows = Sequence[Mapping[str, Any]]


def learning_page(found: Sequence[Mapping[str, Any]], folder: Path) -> tuple[str, str, list[Path]]:
    """File name, text and pictures of the page."""
    lines = ["# Learning with a shield beside the reward", "", MADE, ""]
    for content in found:
        lines += _study(content)
    return PAGE, "\n".join(lines), []


def _study(content: Mapping[str, Any]) -> list[str]:
    settings, rows = content["settings"], content["rows"]
    training = settings["training"]
    stages = training.get("stages", [])
    pool = dict.fromkeys(name for stage in stages for name in stage["opponents"])
    learned = f" against {line(', '.join(pool))}" if pool else ""
    rules = ", ".join(f"{name} {value}" for name, value in training.get("rules", {}).items())
    lines = [
        f"{_trainings(rows)} a cell, of {training['decisions']:,} decisions of a boat, each held for "
        f"{training['interval']} game steps{learned}, on {line(training['preset'])}"
        f"{line(f' with {rules}') if rules else ''}; in training the shield is asked every "
        f"{training.get('shield_every', 1)} game step(s), afterwards in each. Then {settings['games']} games a "
        "training and opponent from the same seeds. Means per game; brackets are 95 % intervals, over games for what "
        "each training brought (bootstrap; hits: exact Poisson limits), over trainings (Student's t) for what another "
        "training would bring. Hits are counted per boat, at the game's distance.",
        "",
    ]
    for opponent in dict.fromkeys(row["opponent"] for row in rows):
        mine = [row for row in rows if row["opponent"] == opponent]
        lines += [f"## Against {line(opponent)}", "", *table(HEADS, _rows(mine)), ""]
        lines += [*_same_network(mine), *table(CHANGES, _changes(mine)), ""]
    return [*lines, *_learning(rows)]


def _trainings(rows: Rows) -> str:
    """How many trainings the cells have, in words."""
    counts = Counter((row["shield"], row["collision"], row["opponent"]) for row in rows).values()
    fewest, most = min(counts, default=0), max(counts, default=0)
    return f"{most} training(s)" if fewest == most else f"{fewest} or {most} trainings"


def _cell(rows: Rows, shield: str, collision: str) -> list[Mapping[str, Any]]:
    return [row for row in rows if row["shield"] == shield and row["collision"] == collision]


def _all(rows: Rows, name: str) -> list[float]:
    """A figure of every game of some trainings."""
    return [one for row in rows for one in row[name]]


def _rows(rows: Rows) -> list[list[str]]:
    cells = [(shield, collision, _cell(rows, shield, collision)) for shield in SHIELDS for collision in ("off", "on")]
    return [[shield, collision, *_figures(cell)] for shield, collision, cell in cells if cell]


def _figures(cell: Rows) -> list[str]:
    means = [f"{np.mean(row['nets']):+.2f}" for row in cell]
    hits = _all(cell, "hit_counts")
    captures, against, changed = (
        f"{np.mean([row[name] for row in cell]):.2f}" for name in ("captures", "captures_against", "interventions")
    )
    net, hit = mean_interval(_all(cell, "nets")), count_interval(round(sum(hits)), len(hits))
    return [_text(net, "+"), ", ".join(means), captures, against, _text(hit), changed]


def _text(one: Interval, sign: str = "") -> str:
    limits = f" ({one.low:{sign}.2f} to {one.high:{sign}.2f})" if np.isfinite(one.low) else ""
    return f"{one.value:{sign}.2f}{limits}"


def _same_network(rows: Rows) -> list[str]:
    """The same network without a shield and with one at deployment, game by game."""
    found = []
    for collision in ("off", "on"):
        off, on = (_cell(rows, shield, collision) for shield in ("none", "deployment"))
        if len(_all(off, "nets")) == len(_all(on, "nets")) > 1:
            net = paired_difference(_all(off, "nets"), _all(on, "nets"))
            hits = count_difference(_all(off, "hit_counts"), _all(on, "hit_counts"))
            found += [
                f"Shield at deployment less none, same networks and starts, game by game, collision term {collision}: "
                f"net captures {_text(net, '+')}, hits {_text(hits, '+')} a game.",
                "",
            ]
    return found


def _changes(rows: Rows) -> list[list[str]]:
    """What a change of the training or deployment brings, by trainings of the same seed."""
    pairs = [(("none", "off"), ("none", "on")), *((("none", "off"), (shield, "off")) for shield in SHIELDS[1:])]
    pairs += [(("deployment", "off"), (shield, "off")) for shield in SHIELDS[2:]]
    found = []
    for before, after in pairs:
        one, two = _cell(rows, *before), _cell(rows, *after)
        if one and len(one) == len(two):
            net, hits = (
                student_interval([np.mean(b[name]) - np.mean(a[name]) for a, b in zip(one, two, strict=True)])
                for name in ("nets", "hit_counts")
            )
            found.append([f"{_named(*before)} to {_named(*after)}", _text(net, "+"), _text(hits, "+")])
    return found


def _named(shield: str, collision: str) -> str:
    return "collision term alone" if collision == "on" else "nothing" if shield == "none" else f"shield, {shield}"


def _learning(rows: Rows) -> list[str]:
    """How fast teams learned: the games of the trainings themselves."""
    first = next(iter(rows), None)
    if first is None or "learned" not in first:
        return []
    mine, found = [row for row in rows if row["opponent"] == first["opponent"]], []
    for shield in (name for name in SHIELDS if name != "deployment"):
        for collision in ("off", "on"):
            cell = _cell(mine, shield, collision)
            if cell:
                quarters = [_mean_told([row["learned"][k] for row in cell], "+") for k in range(4)]
                hits = _mean_told([row["training_hits"] for row in cell])
                found.append([shield, collision, *quarters, hits])
    lines = [
        "## While learning",
        "",
        "Net captures a game in each quarter of the training's decisions, and hits a game over all of it, in the games "
        "learned in; means of the trainings.",
        "",
    ]
    return [*lines, *table(LEARNING, found), ""]


def _mean_told(values: Sequence[float | None], sign: str = "") -> str:
    there = [value for value in values if value is not None]
    return f"{np.mean(there):{sign}.2f}" if there else "-"
