"""`Training`: what all algorithms share: a folder with curve and weights, evaluation games, and `training_of`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.whole_file import whole_file
from steerclear.policies.entrants.learned import batch_of
from steerclear.policies.entrants.learned.network import Network, write_weights
from steerclear.shield.exceptions import ConfigError, SteerclearError
from steerclear.shield.wrappers.tallies import EVENTS, OWN_EVENTS, Tallies, changed_by

from ..provenance import machine, versions
from ..result_files import told_settings, write_table
from ..statistics import mean_interval
from .config import Config
from .env import core_of, shield_of
from .opponents import opponent_of

BEST, FINAL, CURVE, TENSORBOARD = "best.npz", "final.npz", "curve.json", "tensorboard"
Notice = Callable[[int, str], None]
"""Called with the number of decisions made and a progress line."""
MADE_BY = {
    "ppo": ("ppo", "PpoTraining"),
    "qmix": ("qmix", "QmixTraining"),
    "qmix+ppo": ("qmix", "TwoPartTraining"),
    "cloning": ("cloning", "CloningTraining"),
    "raids": ("raids", "RaidsTraining"),
}


class DivergedError(SteerclearError):
    """The loss is no longer finite."""

    def __init__(self, remedy: str) -> None:
        super().__init__(f"the loss is no longer finite; lower {remedy}, earlier work is kept")


def training_of(config: Config, folder: Path, resume: bool) -> Any:
    """Return the training object for a config's algorithm, with ``run(notice)``, ``decisions`` and ``total``."""
    if resume and config.algorithm in ("qmix", "raids"):
        raise ConfigError(f"{config.algorithm} begins anew; leave out --resume")
    module, name = MADE_BY[config.algorithm]
    return getattr(import_module(f".{module}", __package__), name)(config, folder, resume)


class Training:
    """A training in a folder.

    Args:
        config: its settings.
        folder: where all files are written.
        resume: continue from the folder's last checkpoint, if the algorithm writes any.

    Attributes:
        curve: one row per rollout.
        decisions: of all boats together so far.
        total: decisions until the end.
    """

    def __init__(self, config: Config, folder: Path, resume: bool = False) -> None:
        self.config, self.folder = config, folder
        self.curve: list[dict[str, Any]] = []
        self.decisions, self.total = 0, config.decisions
        self.best = -np.inf

    def network(self) -> Network:
        """Return the current actor."""
        raise NotImplementedError

    def evaluate(self) -> dict[str, Any]:
        """Play games against held-out opponents and save the best weights; first save the current ones as final."""
        network, asked = self.network(), self.config.evaluation
        write_weights(network, self.folder / FINAL)
        shielded = self.config.shield != "none"
        found = {
            name: summary_of(play_games(self.config, network, name, asked.games, asked.seed, shielded))
            for name in asked.opponents
        }
        mean = float(np.mean([one["net"] for one in found.values()]))
        if mean > self.best:
            self.best = mean
            write_weights(network, self.folder / BEST)
        return found

    def write_last(self) -> None:
        """Write the current weights as final, and also as best if no evaluation saved any."""
        write_weights(self.network(), self.folder / FINAL)
        if not (self.folder / BEST).exists():
            write_weights(self.network(), self.folder / BEST)

    def write_curve(self, rows: Sequence[dict[str, Any]]) -> None:
        """Write rows as the curve: as JSON; also as Parquet with pyarrow, and for TensorBoard, if installed."""
        settings = told_settings(self.config.told())
        content = {"command": "train", "settings": settings, "rows": rows, "versions": versions(), "machine": machine()}
        with whole_file(self.folder / CURVE, ConfigError) as part:
            part.write_text(json.dumps(content, indent=1), encoding="utf-8")
        if find_spec("pyarrow") is not None and rows:
            write_table(self.folder, [flat(row) for row in rows], Path(CURVE).stem)
        if find_spec("tensorboard") is not None:
            _write_tensorboard(self.folder / TENSORBOARD, rows)


def _write_tensorboard(folder: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write all rows anew, so that a resumed training has one curve."""
    from torch.utils.tensorboard import SummaryWriter

    for old in folder.glob("events.*"):
        old.unlink()
    with SummaryWriter(str(folder)) as writer:
        for row in rows:
            for name, value in flat(row).items():
                if isinstance(value, (int, float)):
                    writer.add_scalar(name.replace(".", "/"), value, row["decisions"])


def flat(row: dict[str, Any], before: str = "") -> dict[str, Any]:
    """Flatten a row: names of nested values are joined by dots."""
    out: dict[str, Any] = {}
    for name, value in row.items():
        out |= flat(value, f"{before}{name}.") if isinstance(value, dict) else {f"{before}{name}": value}
    return out


def means(games: Sequence[dict[str, float]], names: Sequence[str]) -> dict[str, Any]:
    """Return the number of games and the means of their totals; None if no game has ended."""
    found = {name: float(np.mean([one[name] for one in games])) if games else None for name in names}
    return {"games": len(games), **found}


def card_of(config: Config) -> dict[str, Any]:
    """Return the origin of a training's networks, for people."""
    return {
        "trained_with": "steerclear train",
        "preset": config.preset,
        "platform": config.platform,
        "shield": config.shield,
        "seed": config.seed,
        "versions": {name: versions()[name] for name in ("steerclear", "python") if name in versions()},
    }


def device_of(name: str) -> str:
    """Resolve a config's device: cuda, cpu or auto.

    Raises:
        ConfigError: cuda was chosen and torch finds no GPU.
    """
    import torch

    there = torch.cuda.is_available()
    if name == "cuda" and not there:
        raise ConfigError("device is cuda, but torch finds no GPU; set device: auto or cpu")
    return ("cuda" if there else "cpu") if name == "auto" else name


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let torch use that many threads inside."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def play_games(
    config: Config, own: Network, opponent: str, games: int, seed: int, shielded: bool
) -> list[dict[str, float]]:
    """Play games of a network as blue, all at once, and return a row per game.

    Args:
        config: whose rules are played.
        own: the network.
        opponent: name of the opponent.
        games: how many.
        seed: of starts and policies.
        shielded: whether the team has the config's shield.

    Returns:
        Own captures minus the opponent's (``net``) and the counts of `EVENTS`; hits and interventions are the team's.
    """
    core = core_of(config, games, seed)
    core.reset(seed=seed)
    ours, foe = batch_of(own), opponent_of(opponent)
    ours.reset(core, 0, seed)
    foe.reset(core, 1, seed + 1)
    shield = shield_of(config, core) if shielded else None
    boats, others = np.flatnonzero(core.team == 0), np.flatnonzero(core.team == 1)
    tallies, command_filter = Tallies(core, 0, boats), None if shield is None else shield.filter_for(0)
    going, commands = np.ones(games, np.bool_), np.zeros((games, core.n_boats, 2))
    while going.any():
        commands[:, boats], commands[:, others] = ours.act(core, 0), foe.act(core, 1)
        core.step(commands, command_filter)
        tallies.count(going, changed_by(shield, boats, (games, len(boats))))
        going &= ~(core.terminated | core.truncated)
    counts = tallies.step.mean(axis=2)
    whole = [EVENTS.index(name) for name in OWN_EVENTS]
    counts[whole] = tallies.step[whole].sum(axis=2)
    rows = [dict(zip(EVENTS, column.tolist(), strict=True)) for column in counts.T]
    return [{"net": row["captures"] - row["captures_against"], **row} for row in rows]


def summary_of(rows: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Return means per game, and the 95 % interval of the net captures."""
    if not rows:
        return {"games": 0}
    found: dict[str, Any] = {name: float(np.mean([row[name] for row in rows])) for name in ("net", *EVENTS)}
    interval = mean_interval([row["net"] for row in rows])
    for name, limit in (("net_low", interval.low), ("net_high", interval.high)):
        found[name] = limit if np.isfinite(limit) else None  # no interval if all games ended alike
    return {"games": len(rows), **found}
