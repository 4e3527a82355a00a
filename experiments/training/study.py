"""The experiment: {none, deployment, training, training + intervention} x {collision term or not} x seeds.

Trainings with the same games are made once: without a shield and with one at deployment only, the network is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.policies.entrants.learned import read_weights
from steerclear.shield.exceptions import ConfigError

from ..provenance import machine, versions
from ..result_files import finite, lock_folder, read_json, write_json
from ..workers import end_failed, outcomes
from .config import SHIELDS, PpoConfig
from .evaluation import play_games, summary_of
from .training import CURVE, FINAL, training_of

COMMAND, RESULTS = "train-study", "results.json"
COLLISION = {"off": 0.0, "on": 0.25}
"""Weights of the collision term; that of the paper's Table 3."""


@dataclass(frozen=True)
class Cell:
    """One training, and how it is deployed."""

    shield: str
    collision: str
    seed: int

    @property
    def training(self) -> str:
        """Name of the training's folder: deployment changes nothing in it."""
        shield = "none" if self.shield == "deployment" else self.shield
        return f"{shield.replace('+', '_')}-collision_{self.collision}-seed_{self.seed}"


def cells(seeds: int, first: int = 0) -> Iterator[Cell]:
    """All cells of so many seeds."""
    for seed in range(first, first + seeds):
        for collision in COLLISION:
            for shield in SHIELDS:
                yield Cell(shield, collision, seed)


def settings_of_cell(base: PpoConfig, cell: Cell) -> PpoConfig:
    """The base's settings for a cell's training."""
    rewards = {name: weight for name, weight in base.rewards.items() if name not in ("collision", "intervention")}
    if COLLISION[cell.collision]:
        rewards["collision"] = COLLISION[cell.collision]
    shield = "none" if cell.shield == "deployment" else cell.shield
    return base.model_copy(update={"shield": shield, "rewards": rewards, "seed": base.seed + cell.seed})


@dataclass(frozen=True)
class Training:
    """One training of a study, and the cells that play its network: what a worker is handed."""

    base: PpoConfig
    folder: Path
    games: int
    cells: tuple[Cell, ...]

    @property
    def name(self) -> str:
        """Name of its folder."""
        return self.cells[0].training


def trainings_of(base: PpoConfig, folder: Path, seeds: int, games: int) -> list[Training]:
    """The trainings of a study, each once."""
    sharing: dict[str, list[Cell]] = {}
    for cell in cells(seeds):
        sharing.setdefault(cell.training, []).append(cell)
    return [Training(base, folder, games, tuple(each)) for each in sharing.values()]


def run_study(
    base: PpoConfig, folder: Path, seeds: int, games: int, notice: Callable[[int, str], None], jobs: int = 1
) -> dict[str, Any]:
    """Train and play every cell; what a folder holds already is taken from there.

    Args:
        base: settings that all trainings share.
        folder: where trainings and results go.
        seeds: per cell.
        games: played per cell and held-out opponent, not seen in training.
        notice: told cells done, and the training that ended last.
        jobs: trainings at once, a process each.

    Raises:
        ConfigError: QMIX or cloning, as a study is of PPO; the folder holds a study of another config; or a training
            failed: the others are finished before.
        JobFault: one failed by a fault of steerclear.
    """
    if base.algorithm != "ppo":
        raise ConfigError(f"a study is of algorithm: ppo; the config has {base.algorithm}")
    _check_same(base, folder)
    rows: dict[Cell, list[dict[str, Any]]] = {}
    failed = []
    notice(0, "")
    for outcome in outcomes(_rows_of, trainings_of(base, folder, seeds, games), jobs):
        if outcome.answer is None:
            failed.append({**outcome.why, "error": f"{outcome.job.name}: {outcome.error}"})
            continue
        rows.update(outcome.answer)
        notice(len(rows), outcome.job.name)
        write_json(folder / RESULTS, _results(base, seeds, games, rows))
    if failed:
        words = f"{len(failed)} training(s) failed, {len(rows)} cells are done and kept"
        end_failed(failed, words, f"; {failed[0]['error']}; mend that, then the same command")
    return _results(base, seeds, games, rows)


def _check_same(base: PpoConfig, folder: Path) -> None:
    """Refuse a folder whose trainings are of other settings: its networks would count as those of this config.

    Raises:
        ConfigError: they are.
    """
    if not (folder / RESULTS).exists():
        return
    remedy = "name another --out"
    content = read_json(folder / RESULTS, "the results of a study", remedy)
    if not isinstance(content, dict) or content.get("command") != COMMAND:
        raise ConfigError(f"{folder / RESULTS} holds no study; {remedy}")
    before, now = content["settings"]["training"], finite(base.model_dump(mode="json"))
    other = [name for name in now if now[name] != before.get(name)]
    if other:
        raise ConfigError(f"{folder} holds a study of another config ({', '.join(other)}); give its own, or {remedy}")


def _rows_of(training: Training) -> dict[Cell, list[dict[str, Any]]]:
    """Train, or take what is there; play the network in each of its cells."""
    return {cell: _cell_rows(training.base, cell, training.folder, training.games) for cell in training.cells}


def _cell_rows(base: PpoConfig, cell: Cell, folder: Path, games: int) -> list[dict[str, Any]]:
    settings, place = settings_of_cell(base, cell), folder / cell.training
    place.mkdir(parents=True, exist_ok=True)
    lock = lock_folder(place)  # a worker of a study that was killed may still be at it
    training_of(settings, place, resume=True).run()  # of one that is finished nothing is left to do
    del lock
    network = read_weights(place / FINAL)
    curve = read_json(place / CURVE, "the curve of a training", "delete its folder to train it again")
    learning = learning_of(curve["rows"])
    rows = []
    for opponent in base.evaluation.opponents:
        played = play_games(settings, network, opponent, games, base.evaluation.seed, cell.shield != "none")
        each = {"nets": [one["net"] for one in played], "hit_counts": [one["hits"] for one in played]}
        rows.append({**asdict(cell), "opponent": opponent, **summary_of(played), **each, **learning})
    return rows


def learning_of(curve: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """How fast a training learned, and what it cost: means per game that ended in it.

    Args:
        curve: rows of a training.

    Returns:
        ``learned``: captures for less against in each quarter of its decisions, None where no game ended;
        ``training_hits``: over all of it.
    """
    ended = [row for row in curve if row["games"]]
    end = curve[-1]["decisions"]
    quarters: list[list[Mapping[str, Any]]] = [[] for _ in range(4)]
    for row in ended:
        quarters[min(3, int(4 * row["decisions"] / (end + 1)))].append(row)
    learned = [_mean(rows, "captures") - _mean(rows, "captures_against") if rows else None for rows in quarters]
    return {"learned": learned, "training_hits": _mean(ended, "hits") if ended else None}


def _mean(rows: Sequence[Mapping[str, Any]], name: str) -> float:
    """Mean per game."""
    return float(np.average([row[name] for row in rows], weights=[row["games"] for row in rows]))


def _results(base: PpoConfig, seeds: int, games: int, rows: Mapping[Cell, list[dict[str, Any]]]) -> dict[str, Any]:
    in_order = [row for cell in cells(seeds) for row in rows.get(cell, ())]
    about = {"seeds": seeds, "games": games, "training": base.model_dump(mode="json")}
    return {"command": COMMAND, "settings": about, "rows": in_order, "versions": versions(), "machine": machine()}
