"""The page of `train-study`: what a shield does at deployment and in training, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..markdown import MADE, line, table
from ..metrics import Metric
from ..statistics import Interval, difference, figure, student_interval
from .config import SHIELDS

NET = Metric("nets", "mean", "net captures", "", "captures for less against")
HITS = Metric("hit_counts", "count", "hits", "", "new collisions of the team's boats")
HEADS = (
    "shield", "collision term", NET.label, "of each training", "captures", "against", HITS.label, "steps changed",
)  # fmt: skip
LEARNING = ("shield in training", "collision term", "1st quarter", "2nd", "3rd", "4th", HITS.label)
CHANGES = {
    "nothing to collision term alone": (("none", "off"), ("none", "on")),
    **{f"nothing to shield, {shield}": (("none", "off"), (shield, "off")) for shield in SHIELDS[1:]},
    **{f"shield, deployment to shield, {one}": (("deployment", "off"), (one, "off")) for one in SHIELDS[2:]},
}
"""What is compared, by trainings of the same seed: shield and collision term before and after."""
Cells = Mapping[tuple[str, str], pd.DataFrame]


def learning_page(found: Sequence[Mapping[str, Any]], folder: Path) -> tuple[str, str, list[Path]]:
    """File name, text and pictures of the page."""
    lines = ["# Learning with a shield beside the reward", "", MADE, ""]
    for content in found:
        rows = pd.DataFrame(content["rows"])
        lines += [_what_was_done(content["settings"], rows), ""]
        for opponent, mine in rows.groupby("opponent", sort=False):
            lines += [f"## Against {line(opponent)}", "", *_against(_cells(mine))]
        if "learned" in rows:
            lines += _while_learning(_cells(rows[rows["opponent"] == rows["opponent"].iloc[0]]))
    return "learning.md", "\n".join(lines), []


def _what_was_done(settings: Mapping[str, Any], rows: pd.DataFrame) -> str:
    training = settings["training"]
    counts = rows.groupby(["shield", "collision", "opponent"]).size()
    fewest, most = counts.min(), counts.max()
    trainings = f"{most} training(s)" if fewest == most else f"{fewest} or {most} trainings"
    pool = dict.fromkeys(name for stage in training.get("stages", []) for name in stage["opponents"])
    learned = f" against {line(', '.join(pool))}" if pool else ""
    rules = ", ".join(f"{name} {value}" for name, value in training.get("rules", {}).items())
    return (
        f"{trainings} a cell, of {training['decisions']:,} decisions of a boat, each held for "
        f"{training['interval']} game steps{learned}, on {line(training['preset'])}"
        f"{line(f' with {rules}') if rules else ''}; in training the shield is asked every "
        f"{training.get('shield_every', 1)} game step(s), afterwards in each. Then {settings['games']} games a "
        "training and opponent from the same seeds. Means per game; brackets are 95 % intervals, over games for what "
        "each training brought (bootstrap; hits: exact Poisson limits), over trainings (Student's t) for what another "
        "training would bring. Hits are counted per boat, at the game's distance."
    )


def _cells(rows: pd.DataFrame) -> Cells:
    """Trainings by shield and collision term, in the order of the tables."""
    found = dict(iter(rows.groupby(["shield", "collision"])))
    return {key: found[key] for shield in SHIELDS for key in ((shield, "off"), (shield, "on")) if key in found}


def _games(cell: pd.DataFrame) -> pd.DataFrame:
    """One line per game of some trainings."""
    return cell[["nets", "hit_counts"]].explode(["nets", "hit_counts"], ignore_index=True).astype(float)


def _text(one: Interval, sign: str = "") -> str:
    limits = f" ({one.low:{sign}.2f} to {one.high:{sign}.2f})" if np.isfinite(one.low) else ""
    return f"{one.value:{sign}.2f}{limits}"


def _against(cells: Cells) -> list[str]:
    """Every cell; the same networks without a shield and with one at deployment; what changes bring."""
    rows = []
    for (shield, collision), cell in cells.items():
        net, hits = (figure(_games(cell), metric)[0] for metric in (NET, HITS))
        each = ", ".join(f"{np.mean(nets):+.2f}" for nets in cell["nets"])
        captures, against, changed = cell[["captures", "captures_against", "interventions"]].mean()
        told = [f"{captures:.2f}", f"{against:.2f}", _text(hits), f"{changed:.2f}"]
        rows.append([shield, collision, _text(net, "+"), each, *told])
    lines = [*table(HEADS, rows), ""]
    for collision in ("off", "on"):
        games = [_games(cells[key]) for key in (("none", collision), ("deployment", collision)) if key in cells]
        if len(games) == 2 and len(games[0]) == len(games[1]) > 1:
            pairs = games[0].add_suffix("_a").join(games[1].add_suffix("_b"))
            less_net, less_hits = (_text(difference(pairs, metric)[0], "+") for metric in (NET, HITS))
            lines += [
                f"Shield at deployment less none, same networks and starts, game by game, collision term {collision}: "
                f"net captures {less_net}, hits {less_hits} a game.",
                "",
            ]
    changes = []
    for words, (before, after) in CHANGES.items():
        if before in cells and after in cells and len(cells[before]) == len(cells[after]):
            means = [cells[key][["nets", "hit_counts"]].map(np.mean).to_numpy() for key in (before, after)]
            changes.append([words, *(_text(student_interval(one), "+") for one in (means[1] - means[0]).T)])
    return [*lines, *table(("change", NET.label, HITS.label), changes), ""]


def _while_learning(cells: Cells) -> list[str]:
    """How fast teams learned: the games of the trainings themselves."""
    rows = []
    for (shield, collision), cell in cells.items():
        if shield != "deployment":
            quarters = pd.DataFrame(list(cell["learned"]), dtype=float).mean()
            hits = cell["training_hits"].astype(float).mean()
            told = ["-" if np.isnan(one) else f"{one:+.2f}" for one in quarters]
            rows.append([shield, collision, *told, "-" if np.isnan(hits) else f"{hits:.2f}"])
    words = "Net captures a game in each quarter of the training's decisions, and hits a game over all of it, in the "
    words += "games learned in; means of the trainings."
    return ["## While learning", "", words, "", *table(LEARNING, rows), ""]
