"""`Training`: what all algorithms share: a folder with a curve and weights, evaluations, and `training_of`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.whole_file import whole_file
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.entrants.learned.weights_file import write_weights
from steerclear.shield.exceptions import ConfigError, SteerclearError

from ..provenance import machine, versions
from ..result_files import told_settings, write_table
from .evaluation import evaluation_of

BEST, FINAL, CURVE, TENSORBOARD = "best.npz", "final.npz", "curve.json", "tensorboard"
Notice = Callable[[int, str], None]
"""Told decisions made, and words for people."""
MADE_BY = {
    "ppo": ("ppo", "PpoTraining"),
    "qmix": ("qmix", "QmixTraining"),
    "qmix+ppo": ("two_part", "TwoPartTraining"),
    "cloning": ("cloning", "CloningTraining"),
    "raids": ("raids", "RaidsTraining"),
}


class DivergedError(SteerclearError):
    """The network's numbers are no longer finite."""


def training_of(config: Any, folder: Path, resume: bool) -> Any:
    """What trains a config's algorithm, with ``run(notice)``, ``decisions`` and ``total``.

    Raises:
        ConfigError: a setting or checkpoint is unusable, or what begins anew is to be resumed.
    """
    module, name = MADE_BY[config.algorithm]
    return getattr(import_module(f".{module}", __package__), name)(config, folder, resume)


class Training:
    """A training in a folder.

    Args:
        config: what it is to be.
        folder: where everything goes.

    Attributes:
        curve: one row per rollout.
        decisions: of all boats together so far.
        total: decisions until the end.
    """

    def __init__(self, config: Any, folder: Path) -> None:
        self.config, self.folder = config, folder
        self.curve: list[dict[str, Any]] = []
        self.decisions, self.total = 0, int(getattr(config, "decisions", 0))
        self.best = -np.inf

    def network(self) -> Network:
        """The actor as it is now."""
        raise NotImplementedError

    def evaluate(self) -> dict[str, Any]:
        """Games against held-out opponents, and the best kept; the weights as they are lie there before the first."""
        network = self.network()
        write_weights(network, self.folder / FINAL)
        found = evaluation_of(self.config, network)
        mean = float(np.mean([one["net"] for one in found.values()]))
        if mean > self.best:
            self.best = mean
            write_weights(network, self.folder / BEST)
        return found

    def write_last(self) -> None:
        """Write the weights as they are, as the best too where no evaluation found any."""
        write_weights(self.network(), self.folder / FINAL)
        if not (self.folder / BEST).exists():
            write_weights(self.network(), self.folder / BEST)

    def write_curve(self, rows: Sequence[dict[str, Any]]) -> None:
        """Write rows as the curve: JSON always, Parquet where pyarrow is there, TensorBoard where that is.

        Raises:
            ConfigError: it cannot be written.
        """
        content = {
            "command": "train",
            "settings": told_settings(self.config.model_dump(mode="json")),
            "rows": list(rows),
            "versions": versions(),
            "machine": machine(),
        }
        with whole_file(self.folder / CURVE, ConfigError) as part:
            part.write_text(json.dumps(content, indent=1), encoding="utf-8")
        if find_spec("pyarrow") is not None and rows:
            write_table(self.folder, [flat(row) for row in rows], Path(CURVE).stem)
        if find_spec("tensorboard") is not None:
            _write_tensorboard(self.folder / TENSORBOARD, rows)


def _write_tensorboard(folder: Path, rows: Sequence[dict[str, Any]]) -> None:
    """All rows anew: so that a resumed training has one curve."""
    from torch.utils.tensorboard import SummaryWriter

    for old in folder.glob("events.*"):
        old.unlink()
    with SummaryWriter(str(folder)) as writer:
        for row in rows:
            for name, value in flat(row).items():
                if isinstance(value, (int, float)):
                    writer.add_scalar(name.replace(".", "/"), value, row["decisions"])


def flat(row: dict[str, Any], before: str = "") -> dict[str, Any]:
    """A row with the names of nested values joined by dots."""
    out: dict[str, Any] = {}
    for name, value in row.items():
        out |= flat(value, f"{before}{name}.") if isinstance(value, dict) else {f"{before}{name}": value}
    return out


def means(games: Sequence[dict[str, float]], names: Sequence[str]) -> dict[str, Any]:
    """Number of games and means of their totals; None where no game has ended."""
    found = {name: float(np.mean([one[name] for one in games])) if games else None for name in names}
    return {"games": len(games), **found}


def card_of(config: Any) -> dict[str, Any]:
    """Where the networks of a training come from, for people."""
    return {
        "trained_with": "steerclear train",
        "preset": config.preset,
        "platform": config.platform,
        "shield": config.shield,
        "seed": config.seed,
        "versions": {name: versions()[name] for name in ("steerclear", "python") if name in versions()},
    }


def device_of(name: str) -> str:
    """The device of a config's word.

    Raises:
        ConfigError: it is not there.
    """
    import torch

    there = torch.cuda.is_available()
    if name == "cuda" and not there:
        raise ConfigError("device is cuda, but torch finds no GPU; set device: auto or cpu")
    return ("cuda" if there else "cpu") if name == "auto" else name


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let torch use so many threads inside."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
