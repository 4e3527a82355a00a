"""Behaviour cloning over options: which option a demonstrator follows is learned from what it saw; numpy only.

Pomerleau (1989): supervised learning of a demonstrator's choices. Here the choices are Crowley-BU-LL's options, so what
is learned is when to do what; how it is done stays written by hand.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.mctf import MctfEnv
from steerclear.policies import make
from steerclear.policies.entrants.learned.chooser import OPTION_NAMES, Chooser, write_chooser
from steerclear.policies.entrants.learned.teacher import Teacher
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import install_command

from .checks import check_options
from .curve import write_curve
from .games import core_of
from .settings import TrainingSettings

DEMONSTRATIONS = "demonstrations"
RANGES = {
    "epochs": (int, 1, 10**6),
    "rate": (float, 1e-9, 1e3),
    "hidden": (int, 1, 4096),
    "batch": (int, 1, 10**7),
}
"""Options beside the demonstrations."""
HELD_OUT = 0.2


class CloningTraining:
    """Demonstrations of the scripted demonstrator (or of people, from Parquet), and a network that chooses as it does.

    Args:
        settings: ``options`` may hold ``demonstrations`` (a file of ``steerclear demonstrate``; none: games of the
            scripted demonstrator, as many as ``games``), ``epochs``, ``rate``, ``hidden`` and ``batch``.
        folder: where everything goes.
        resume: is not looked at: it takes seconds.

    Raises:
        ConfigError: an option that is unknown or cannot be, or demonstrations that are none.
    """

    def __init__(self, settings: TrainingSettings, folder: Path, resume: bool = False) -> None:
        numbers = {name: value for name, value in settings.options.items() if name != DEMONSTRATIONS}
        check_options("cloning", numbers, RANGES)
        if not isinstance(settings.options.get(DEMONSTRATIONS, ""), str):
            raise ConfigError("options.demonstrations is no name of a file; give one of steerclear demonstrate")
        self.settings, self.folder, self.decisions = settings, folder, 0

    def run(self, notice: Any = lambda done, words: None) -> None:
        """Play or read, learn, write."""
        options = self.settings.options
        source = options.get(DEMONSTRATIONS)
        rows = _read(Path(source)) if source else self._played(notice)
        chooser, curve = fitted(
            rows,
            int(options.get("epochs", 200)),
            float(options.get("rate", 3e-3)),
            int(options.get("hidden", 64)),
            int(options.get("batch", 256)),
            self.settings.seed,
            {"demonstrations": "people" if source else "scripted demonstrator", "rows": len(rows)},
        )
        write_chooser(chooser, self.folder / "final.npz")
        write_chooser(chooser, self.folder / "best.npz")
        write_curve(self.folder, curve, self.settings)
        self.decisions = self.settings.decisions
        notice(self.decisions, f"agrees in {curve[-1]['agrees']:.0%} of held-out choices")

    def _played(self, notice: Any) -> list[dict[str, Any]]:
        """Rows of the scripted demonstrator's games."""
        rows: list[dict[str, Any]] = []
        opponents = self.settings.stages[0].opponents
        for game in range(self.settings.games):
            rows += demonstrated(self.settings, opponents[game % len(opponents)], self.settings.seed + game)
            self.decisions = int(self.settings.decisions * 0.9 * (game + 1) / self.settings.games)
            notice(self.decisions, f"demonstrations, {len(rows):,} choices")
        return rows


def demonstrated(settings: TrainingSettings, opponent: str, seed: int) -> list[dict[str, Any]]:
    """Rows of one game of the scripted demonstrator."""
    config = core_of(settings, 1, seed).config
    env = MctfEnv(config, action_kind="continuous")
    observations, infos = env.reset(seed=seed)
    teacher, foe = Teacher(), make(opponent)
    own, others = list(config.agent_ids[: config.team_size]), list(config.agent_ids[config.team_size :])
    teacher.reset(env, own, seed)
    foe.reset(env, others, seed + 1)
    while env.agents:
        actions = {**teacher.act(observations, infos), **foe.act(observations, infos)}
        observations, _, _, _, infos = env.step(actions)
    return teacher.rows


def _read(path: Path) -> list[dict[str, Any]]:
    """Rows of a file of ``steerclear demonstrate``.

    Raises:
        ConfigError: there is none, or pyarrow is missing.
    """
    try:
        import pyarrow.parquet as parquet
    except ModuleNotFoundError as error:
        raise ConfigError(f"Parquet files need pyarrow; {install_command('parquet')}") from error
    try:
        return parquet.read_table(path).to_pylist()
    except (OSError, ValueError) as error:
        raise ConfigError(f"cannot read demonstrations from {path} ({error}); give a file of demonstrate") from error


def fitted(
    rows: list[dict[str, Any]], epochs: int, rate: float, hidden: int, batch: int, seed: int, card: dict[str, Any]
) -> tuple[Chooser, list[dict[str, Any]]]:
    """A chooser fitted to rows, and its curve: cross-entropy with Adam, a fifth of the rows held out.

    Raises:
        ConfigError: too few rows, or rows without what was seen.
    """
    try:
        names = Chooser.columns(rows[0])
        seen = np.array([[float(row[name]) for name in names] for row in rows])
        chosen = np.array([OPTION_NAMES.index(row["option"]) for row in rows])
    except (IndexError, KeyError, ValueError, TypeError) as error:
        raise ConfigError(f"the demonstrations hold no choices ({error}); record some with demonstrate") from error
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(rows))
    held = order[: max(1, int(HELD_OUT * len(rows)))]
    learned = order[len(held) :]
    if len(learned) < 10:
        raise ConfigError(f"{len(rows)} choices are too few; record 20 at least")
    chooser = Chooser.fresh(names, hidden, rng, card)
    chooser.scale_to(seen[learned])
    curve, optimiser = [], _Adam(chooser.parameters(), rate)
    for epoch in range(epochs):
        for part in np.array_split(rng.permutation(learned), max(1, len(learned) // batch)):
            optimiser.step(chooser.gradients(seen[part], chosen[part]))
        if epoch % 10 == 9 or epoch == epochs - 1:
            agrees = float(np.mean(chooser.choices(seen[held]) == chosen[held]))
            curve.append({"decisions": (epoch + 1) * len(learned), "epoch": epoch + 1, "agrees": agrees})
    return chooser, curve


class _Adam:
    """Kingma and Ba (2015), in place.

    Args:
        parameters: arrays to change.
        rate: step.
    """

    def __init__(self, parameters: list[np.ndarray], rate: float) -> None:
        self._parameters, self._rate, self._steps = parameters, rate, 0
        self._first = [np.zeros_like(one) for one in parameters]
        self._second = [np.zeros_like(one) for one in parameters]

    def step(self, gradients: list[np.ndarray]) -> None:
        """Go one step down."""
        self._steps += 1
        scale = self._rate * np.sqrt(1.0 - 0.999**self._steps) / (1.0 - 0.9**self._steps)
        for value, first, second, gradient in zip(self._parameters, self._first, self._second, gradients, strict=True):
            first += 0.1 * (gradient - first)
            second += 0.001 * (gradient**2 - second)
            value -= scale * first / (np.sqrt(second) + 1e-8)
