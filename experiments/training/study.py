"""`train-study`: {no shield, deployment, training, training + intervention} x {collision term or not} x seeds.

Each distinct training is run once: "no shield" and "deployment" share a network.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from steerclear.policies.entrants.learned import read_weights
from steerclear.shield.exceptions import ConfigError

from ..markdown import MADE, line, table
from ..metrics import Metric
from ..result_files import finite, lock_folder, read_json, told_settings
from ..runner import EXPERIMENT_FILE, RESULTS_FILE, ROWS_FILE, Experiment, Interrupted, execute
from ..statistics import Interval, difference, figure, student_interval
from ..words import count_text
from ..workers import Job, Row, end_failed
from .config import SHIELDS, Config, config_of
from .training import CURVE, FINAL, play_games, summary_of, training_of

if TYPE_CHECKING:
    import pandas as pd

COMMAND = "train-study"
COLLISION = {"off": 0.0, "on": 0.25}
"""Weights of the collision term; 0.25 is from the paper's Table 3."""
PLAYED_WITH = {
    "none": ("none", "deployment"),
    "training": ("training",),
    "training+intervention": ("training+intervention",),
}
"""By the shield in training, the study's cells that its network plays."""

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
"""Comparisons between trainings of the same seed: shield and collision term before and after."""
Cells: TypeAlias = "Mapping[tuple[str, str], pd.DataFrame]"


def trainings_of(base: Config, folder: Path, seeds: int, games: int) -> list[Job]:
    """Return a job per training: its folder, full config, and the cells that its network plays."""
    if base.algorithm != "ppo":
        raise ConfigError(f"a study is of algorithm: ppo; the config has {base.algorithm}")
    return [
        {
            "folder": str(folder.resolve() / f"{shield.replace('+', '_')}-collision_{collision}-seed_{seed}"),
            "config": config_of_training(base, shield, weight, seed).told(),
            "cells": [{"shield": one, "collision": collision, "seed": seed} for one in played_with],
            "games": games,
        }
        for seed in range(seeds)
        for collision, weight in COLLISION.items()
        for shield, played_with in PLAYED_WITH.items()
    ]


def config_of_training(base: Config, shield: str, collision: float, seed: int) -> Config:
    """Return the base's settings with the given shield mode, collision weight and seed offset."""
    rewards = {name: weight for name, weight in base.rewards.items() if name not in ("collision", "intervention")}
    rewards |= {"collision": collision} if collision else {}
    return base.model_copy(update={"shield": shield, "rewards": rewards, "seed": base.seed + seed})


def train_and_play(job: Job) -> list[Row]:
    """Train or resume, then play the network in each of its cells; return a row per cell and opponent."""
    config, folder = config_of(job["config"]), Path(job["folder"])
    folder.mkdir(parents=True, exist_ok=True)
    lock = lock_folder(folder)  # a worker of a killed study may still be running
    training_of(config, folder, resume=True).run()  # returns at once if finished
    del lock
    network = read_weights(folder / FINAL)
    learning = learning_of(read_json(folder / CURVE, "the curve of a training", "delete its folder")["rows"])
    rows = []
    for cell in job["cells"]:
        for opponent in config.evaluation.opponents:
            shielded = cell["shield"] != "none"
            played = play_games(config, network, opponent, job["games"], config.evaluation.seed, shielded)
            each = {"nets": [one["net"] for one in played], "hit_counts": [one["hits"] for one in played]}
            rows.append({**cell, "opponent": opponent, **summary_of(played), **each, **learning})
    return rows


def learning_of(curve: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return net captures per game in each quarter of a training, and hits per game over all of it."""
    ended, end = [row for row in curve if row["games"]], curve[-1]["decisions"]
    quarters: list[list[Mapping[str, Any]]] = [[] for _ in range(4)]
    for row in ended:
        quarters[min(3, int(4 * row["decisions"] / (end + 1)))].append(row)
    learned = [_mean(rows, "captures") - _mean(rows, "captures_against") if rows else None for rows in quarters]
    return {"learned": learned, "training_hits": _mean(ended, "hits") if ended else None}


def _mean(rows: Sequence[Mapping[str, Any]], name: str) -> float:
    """Return the mean per game."""
    return float(np.average([row[name] for row in rows], weights=[row["games"] for row in rows]))


def run_study(
    base: Config, folder: Path, seeds: int, games: int, notice: Callable[[int, int], None], jobs: int = 1
) -> dict[str, Any]:
    """Train and play every cell and write the results; cells already in the folder are reused.

    Args:
        base: settings that all trainings share.
        folder: for trainings and results.
        seeds: per cell.
        games: per cell and held-out opponent, which training did not use.
        notice: called with the numbers of finished and of all trainings.
        jobs: simultaneous trainings, one process each.
    """
    trainings = trainings_of(base, folder, seeds, games)
    settings = {"seeds": seeds, "games": games, "training": base.told()}
    _check_same(told_settings(settings)["training"], folder)
    experiment = Experiment(COMMAND, settings, trainings, train_and_play, "trainings")
    begun = any((folder / name).exists() for name in (ROWS_FILE, RESULTS_FILE))
    run = execute(experiment, folder, jobs, begun, notice)
    results = {**run.head(), "rows": run.rows}
    run.write(results)
    if run.interrupted:
        raise Interrupted(f"interrupted: what is done is kept in {folder}; the same command goes on from there")
    if run.failed:
        first, kept = run.failed[0], {(row["shield"], row["collision"], row["seed"]) for row in run.rows}
        words = f"{len(run.failed)} training(s) failed, {len(kept)} cells are done and kept"
        end_failed(run.failed, words, f"; {Path(first['folder']).name}: {first['error']}; mend that, then run it again")
    return results


def _check_same(training: Mapping[str, Any], folder: Path) -> None:
    """Raise if the folder has a study with other settings, whose networks would count as this config's."""
    for name in (EXPERIMENT_FILE, RESULTS_FILE):
        if not (folder / name).exists():
            continue
        content = read_json(folder / name, "a study", "name another --out")
        if not isinstance(content, dict) or content.get("command") != COMMAND:
            raise ConfigError(f"{folder / name} holds no study; name another --out")
        before, now = content["settings"]["training"], finite(training)
        other = [name for name in now if now[name] != before.get(name)]
        if other:
            raise ConfigError(
                f"{folder} holds a study of another config ({', '.join(other)}); give its own, or name another --out"
            )


def learning_page(found: Sequence[Mapping[str, Any]], folder: Path) -> tuple[str, str, list[Path]]:
    """Return file name, text and pictures of the page."""
    import pandas as pd

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
    trainings = count_text(most, "training") if fewest == most else f"{fewest} or {most} trainings"
    pool = dict.fromkeys(name for stage in training.get("stages", []) for name in stage["opponents"])
    learned = f" against {line(', '.join(pool))}" if pool else ""
    rules = ", ".join(f"{name} {value}" for name, value in training.get("rules", {}).items())
    return (
        f"{trainings} a cell, of {training['decisions']:,} decisions of a boat, each held for "
        f"{training['interval']} game steps{learned}, on {line(training['preset'])}"
        f"{line(f' with {rules}') if rules else ''}; in training the shield is asked every "
        f"{count_text(training.get('shield_every', 1), 'game step')}, afterwards in each. Then "
        f"{count_text(settings['games'], 'game')} a "
        "training and opponent from the same seeds. Means per game; brackets are 95 % intervals, over games for what "
        "each training brought (bootstrap; hits: exact Poisson limits), over trainings (Student's t) for what another "
        "training would bring. Hits are counted per boat, at the game's distance."
    )


def _cells(rows: pd.DataFrame) -> Cells:
    """Return the trainings by shield and collision term, in the order of the tables."""
    found = dict(iter(rows.groupby(["shield", "collision"])))
    return {key: found[key] for shield in SHIELDS for key in ((shield, "off"), (shield, "on")) if key in found}


def _games(cell: pd.DataFrame) -> pd.DataFrame:
    """Return one line per game of some trainings."""
    return cell[["nets", "hit_counts"]].explode(["nets", "hit_counts"], ignore_index=True).astype(float)


def _text(one: Interval, sign: str = "") -> str:
    limits = f" ({one.low:{sign}.2f} to {one.high:{sign}.2f})" if np.isfinite(one.low) else ""
    return f"{one.value:{sign}.2f}{limits}"


def _against(cells: Cells) -> list[str]:
    """Report every cell, the effect of a shield at deployment on the same networks, and the changes."""
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
    """Report results of the training games, by quarter."""
    import pandas as pd

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
