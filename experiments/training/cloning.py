"""Behaviour cloning over options: a network learns which option a demonstrator follows; numpy only.

Supervised learning of a demonstrator's choices (Pomerleau 1989). The choices are Crowley-BU-LL's options: when to use
an option is learned, how to carry it out is hand-written.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.mctf import MctfEnv
from steerclear.policies import make
from steerclear.policies.entrants.learned.cloned import OPTION_NAMES, Chooser, Teacher, write_chooser
from steerclear.shield.exceptions import ConfigError

from .config import CloningOptions, Config
from .env import core_of
from .training import BEST, FINAL, Notice, Training

HELD_OUT = 0.2


class CloningTraining(Training):
    """Trains a network on choices of the scripted demonstrator; takes seconds, so it cannot be resumed."""

    def __init__(self, config: Config, folder: Path, resume: bool = False) -> None:
        super().__init__(config, folder)
        self.total = config.games

    def run(self, notice: Notice = lambda done, words: None) -> None:
        """Play the demonstrations, fit, and write weights and curve."""
        rows = self._played(notice)
        about = {"demonstrations": "scripted demonstrator", "rows": len(rows)}
        chooser, curve = fitted(rows, self.config.options, self.config.seed, about)
        write_chooser(chooser, self.folder / FINAL)
        write_chooser(chooser, self.folder / BEST)
        self.write_curve(curve)
        self.decisions = self.total
        notice(self.decisions, f"agrees in {curve[-1]['agrees']:.0%} of held-out choices")

    def _played(self, notice: Any) -> list[dict[str, Any]]:
        """Return the rows of the demonstrator's games."""
        rows: list[dict[str, Any]] = []
        opponents = self.config.stages[0].opponents
        for game in range(self.total):
            rows += demonstrated(self.config, opponents[game % len(opponents)], self.config.seed + game)
            notice(game, f"demonstrations, {len(rows):,} choices")
        return rows


def demonstrated(config: Config, opponent: str, seed: int) -> list[dict[str, Any]]:
    """Return the rows of one game of the scripted demonstrator."""
    rules = core_of(config, 1, seed).config
    env = MctfEnv(rules, action_kind="continuous")
    observations, infos = env.reset(seed=seed)
    teacher, foe = Teacher(), make(opponent)
    own, others = list(rules.agent_ids[: rules.team_size]), list(rules.agent_ids[rules.team_size :])
    teacher.reset(env, own, seed)
    foe.reset(env, others, seed + 1)
    while env.agents:
        actions = {**teacher.act(observations, infos), **foe.act(observations, infos)}
        observations, _, _, _, infos = env.step(actions)
    return teacher.rows


def fitted(
    rows: list[dict[str, Any]], options: CloningOptions, seed: int, card: dict[str, Any]
) -> tuple[Chooser, list[dict[str, Any]]]:
    """Fit a chooser by cross-entropy with Adam, a fifth of the rows held out; return it and its curve."""
    names = Chooser.columns(rows[0]) if rows else []
    seen = np.array([[float(row[name]) for name in names] for row in rows])
    chosen = np.array([OPTION_NAMES.index(row["option"]) for row in rows])
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(rows))
    held = order[: max(1, int(HELD_OUT * len(rows)))]
    learned = order[len(held) :]
    if len(learned) < 10:
        raise ConfigError(f"{len(rows)} choices are too few; give more games")
    chooser = Chooser.fresh(names, options.hidden, rng, card)
    chooser.scale_to(seen[learned])
    curve, optimiser = [], _Adam(chooser.parameters(), options.rate)
    for epoch in range(options.epochs):
        for part in np.array_split(rng.permutation(learned), max(1, len(learned) // options.batch)):
            optimiser.step(chooser.gradients(seen[part], chosen[part]))
        if epoch % 10 == 9 or epoch == options.epochs - 1:
            agrees = float(np.mean(chooser.choices(seen[held]) == chosen[held]))
            curve.append({"decisions": (epoch + 1) * len(learned), "epoch": epoch + 1, "agrees": agrees})
    return chooser, curve


class _Adam:
    """Adam (Kingma and Ba 2015), in place."""

    def __init__(self, parameters: list[np.ndarray], rate: float) -> None:
        self._parameters, self._rate, self._steps = parameters, rate, 0
        self._first = [np.zeros_like(one) for one in parameters]
        self._second = [np.zeros_like(one) for one in parameters]

    def step(self, gradients: list[np.ndarray]) -> None:
        """Apply one descent step."""
        self._steps += 1
        scale = self._rate * np.sqrt(1.0 - 0.999**self._steps) / (1.0 - 0.9**self._steps)
        for value, first, second, gradient in zip(self._parameters, self._first, self._second, gradients, strict=True):
            first += 0.1 * (gradient - first)
            second += 0.001 * (gradient**2 - second)
            value -= scale * first / (np.sqrt(second) + 1e-8)
