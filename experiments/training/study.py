"""`train-study`: {no shield, deployment, training, training + intervention} x {collision term or not} x seeds.

Trainings with the same games are made once: without a shield and with one at deployment only, the network is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.policies.entrants.learned import read_weights
from steerclear.shield.exceptions import ConfigError

from ..result_files import finite, lock_folder, read_json, told_settings
from ..runner import EXPERIMENT_FILE, RESULTS_FILE, ROWS_FILE, Experiment, Interrupted, execute
from ..workers import Job, Row, end_failed
from .config import PpoConfig
from .config_file import config_of
from .evaluation import play_games, summary_of
from .training import CURVE, FINAL, training_of

COMMAND = "train-study"
COLLISION = {"off": 0.0, "on": 0.25}
"""Weights of the collision term; that of the paper's Table 3."""
PLAYED_WITH = {
    "none": ("none", "deployment"),
    "training": ("training",),
    "training+intervention": ("training+intervention",),
}
"""By the shield in training, the cells of the study that its network plays."""


def trainings_of(base: PpoConfig, folder: Path, seeds: int, games: int) -> list[Job]:
    """A job per training: its folder, its whole config, and what its network is played with.

    Raises:
        ConfigError: the config is not of PPO.
    """
    if base.algorithm != "ppo":
        raise ConfigError(f"a study is of algorithm: ppo; the config has {base.algorithm}")
    return [
        {
            "folder": str(folder.resolve() / f"{shield.replace('+', '_')}-collision_{collision}-seed_{seed}"),
            "config": config_of_training(base, shield, weight, seed).model_dump(mode="json"),
            "cells": [{"shield": one, "collision": collision, "seed": seed} for one in played_with],
            "games": games,
        }
        for seed in range(seeds)
        for collision, weight in COLLISION.items()
        for shield, played_with in PLAYED_WITH.items()
    ]


def config_of_training(base: PpoConfig, shield: str, collision: float, seed: int) -> PpoConfig:
    """The base's settings with a shield mode, a weight of the collision term and a seed of its own."""
    rewards = {name: weight for name, weight in base.rewards.items() if name not in ("collision", "intervention")}
    rewards |= {"collision": collision} if collision else {}
    return base.model_copy(update={"shield": shield, "rewards": rewards, "seed": base.seed + seed})


def train_and_play(job: Job) -> list[Row]:
    """Train, or go on with what is there, and play the network in each of its cells; a row per cell and opponent."""
    config, folder = config_of(job["config"]), Path(job["folder"])
    folder.mkdir(parents=True, exist_ok=True)
    lock = lock_folder(folder)  # a worker of a study that was killed may still be at it
    training_of(config, folder, resume=True).run()  # of one that is finished nothing is left to do
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
    """How fast a training learned, and what it cost: means per game that ended in it.

    Args:
        curve: rows of a training.

    Returns:
        ``learned``: captures for less against in each quarter of its decisions, None where no game ended;
        ``training_hits``: over all of it.
    """
    ended, end = [row for row in curve if row["games"]], curve[-1]["decisions"]
    quarters: list[list[Mapping[str, Any]]] = [[] for _ in range(4)]
    for row in ended:
        quarters[min(3, int(4 * row["decisions"] / (end + 1)))].append(row)
    learned = [_mean(rows, "captures") - _mean(rows, "captures_against") if rows else None for rows in quarters]
    return {"learned": learned, "training_hits": _mean(ended, "hits") if ended else None}


def _mean(rows: Sequence[Mapping[str, Any]], name: str) -> float:
    """Mean per game."""
    return float(np.average([row[name] for row in rows], weights=[row["games"] for row in rows]))


def run_study(
    base: PpoConfig, folder: Path, seeds: int, games: int, notice: Callable[[int, int], None], jobs: int = 1
) -> dict[str, Any]:
    """Train and play every cell, write the results; what a folder holds already is taken from there.

    Args:
        base: settings that all trainings share.
        folder: where trainings and results go.
        seeds: per cell.
        games: played per cell and held-out opponent, not seen in training.
        notice: told how many trainings are done and how many there are.
        jobs: trainings at once, a process each.

    Raises:
        ConfigError: the config is not of PPO; the folder holds a study of another config; or a training failed: the
            others are finished before.
        JobFault: one failed by a fault of steerclear.
        Interrupted: by Ctrl-C or SIGTERM; the results of what is done are written.
    """
    trainings = trainings_of(base, folder, seeds, games)
    settings = {"seeds": seeds, "games": games, "training": base.model_dump(mode="json")}
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
    """Refuse a folder whose trainings are of other settings: its networks would count as those of this config.

    Raises:
        ConfigError: they are.
    """
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
