"""Raids that learn: PPO over the numbers of a scripted raid, in games that begin where raids go to their next phase."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.entrants.learned.raids import BOATS, SEEN, RaidsBatch
from steerclear.policies.entrants.learned.weights_file import read_weights, write_weights
from steerclear.policies.entrants.undertow.raid import Phase
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray

from ..play.spec import near
from .checks import number
from .curve import write_curve
from .games import learners_of, set_stage
from .playing import evaluation_of, keep_best
from .pool import Pool
from .raid_moments import KINDS, BeginInRaids, RaidMoments, recorded
from .raids_learner import NONE, Answer, RaidsLearner
from .settings import TrainingSettings
from .training import BEST, FINAL, card_of

DEFAULTS = {
    "recorded": [0.0, 0.4],
    "shares": [0.15, 0.35, 0.3, 0.2, 0.0, 0.0],
    "spread": 0.5,
    "furthest": 0.05,
}
"""Deviations of the numbers in games that moments are recorded from, for each as many as are played at once; how often
each of `raid_moments.KINDS` comes; deviation of what is drawn at first; see `RaidsLearner`."""
LONGEST_S = 100.0
"""Time until a game that began in a raid is over, s."""
RECORDED_SEED = 810_000
"""First seeds of the games that moments are recorded from are multiples of it."""
COUNTS = ("captures", "captures_against", "grabs", "grabs_against", "hits")


class RaidsTraining:
    """A training of raids in a folder; checkpoints are not kept: it begins anew.

    Args:
        settings: ``options`` may hold `DEFAULTS`' names; a decision is one of a team.
        folder: where everything goes.
        resume: refused.

    Raises:
        ConfigError: an option that is unknown or cannot be, teams not of three boats, or ``resume``.
    """

    def __init__(self, settings: TrainingSettings, folder: Path, resume: bool = False) -> None:
        self.options = _checked(settings, resume)
        self.settings, self.folder, self.decisions = settings, folder, 0
        self.curve: list[dict[str, Any]] = []
        self._best, self._card = -np.inf, card_of(settings)
        self.pool = Pool(settings.stages[0], settings.league, settings.seed, settings.entrants_every)
        self.batch = learners_of(replace(settings, interval=1), self.pool)
        self.batch.actions = "continuous"
        self.team = RaidsBatch(Network([], [], NONE, "tanh", "raids", settings.interval, SEEN))  # is never asked
        self._all = np.arange(settings.games)
        self._open: list[Answer | None] = [None] * settings.games
        self.learner = RaidsLearner(settings, self.options["spread"], self.options["furthest"])
        if settings.start:
            self.learner.begin_with(read_weights(settings.start))

    def run(self, notice: Any = lambda done, words: None) -> None:
        """Record, learn, write; what is interrupted keeps all up to the last whole rollout."""
        self._begin(notice)
        threads = torch.get_num_threads()
        torch.set_num_threads(self.settings.threads)
        try:
            while self.decisions < self.settings.decisions:
                notice(self.decisions, self._iterate())
        finally:
            write_weights(self.network(), self.folder / FINAL)
            write_curve(self.folder, self.curve, self.settings)
            torch.set_num_threads(threads)
        if not (self.folder / BEST).exists():
            write_weights(self.network(), self.folder / BEST)

    def network(self) -> Network:
        """The actor as it is now."""
        return self.learner.network(self._card)

    def _begin(self, notice: Any) -> None:
        """Record moments, and begin games at them."""
        seed, found = self.settings.seed, []
        for part, spread in enumerate(self.options["recorded"], start=1):
            found += recorded(self.settings, spread, part * RECORDED_SEED + seed)
            notice(0, f"moments recorded in {part * self._all.size} games")
        core, shares = self.batch.core, self.options["shares"]
        self._begun = BeginInRaids(core, RaidMoments.of(found, shares), shares, seed)
        set_stage(self.batch, self.settings, self.settings.stages[0], (self.batch.shield, self.batch._filter))
        self.batch.reset(seed)
        self.team.reset(core, 0, seed)
        self._restart(np.ones(core.n_games, np.bool_))

    def _iterate(self) -> str:
        """A rollout and what is learned from it; words for people."""
        began = time.perf_counter()
        answers, games = self._rollout()
        played = time.perf_counter()
        told = self.learner.learn(answers)
        row = {"decisions": self.decisions, **_means(games), **told}
        row["wall"] = {"playing_s": played - began, "learning_s": time.perf_counter() - played}
        self.curve.append(row)
        if len(self.curve) % self.settings.evaluation.every == 0 or self.decisions >= self.settings.decisions:
            row["evaluation"] = self._evaluate()
            write_curve(self.folder, self.curve, self.settings)
        return f"captures {row['captures'] or 0.0:.2f}, against {row['captures_against'] or 0.0:.2f} a raid"

    def _rollout(self) -> tuple[list[list[Answer]], list[dict[str, float]]]:
        """Answers of each game in order, and totals of games that ended."""
        answers: list[list[Answer]] = [[] for _ in self._all]
        ended: list[dict[str, float]] = []
        for _ in range(self.settings.ppo.steps):
            asked = self.team.advance(self._all)
            self._answer(self._renewed(asked, answers, ended), answers)
            earned, over = self._decide(ended)
            for game, one in enumerate(self._open):
                if one is not None:
                    one.earned += earned[game] * self.settings.ppo.discount**one.decisions
                    one.decisions += 1
            self._close(over, answers)
            self._restart(over)
        return answers, ended

    def _answer(self, asked: Any, answers: list[list[Answer]]) -> None:
        """Let the network answer in the games that ask."""
        if not asked.size:
            return
        given = self.learner.answers(self.team.seen(asked))
        self.team.shape(asked, np.stack([one.units for one in given]))
        for game, one in zip(asked, given, strict=True):
            before = self._open[game]
            if before is not None:
                before.after = one.seen
                answers[game].append(before)
            self._open[game] = one

    def _decide(self, ended: list[dict[str, float]]) -> tuple[Array, BoolArray]:
        """A decision in all games: what the team earned (B,), and which games ended (B,)."""
        earned, over = np.zeros(self._all.size), np.zeros(self._all.size, np.bool_)
        self.team.aim(self._all, self.settings.interval)
        for _ in range(self.settings.interval):
            commands = np.where(over[:, None, None], 0.0, self.team.steered())
            out = self.batch.step(commands.reshape(-1, 2))
            earned += np.where(over, 0.0, out.rewards.reshape(over.size, -1).mean(axis=1))
            fresh = (out.terminated | out.truncated)[::BOATS] & ~over
            ended += self._totals(out.episodes, fresh)
            over |= fresh
        self.decisions += self._all.size
        return earned, over

    def _renewed(self, asked: Any, answers: list[list[Answer]], ended: list[dict[str, float]]) -> Any:
        """Begin games anew whose raid is over, or where no opponent stays at home the time; the games that ask now."""
        raids, core = self.team.raids, self.batch.core
        ended_raid = [raid.phase == Phase.GATHER and not raid.unguarded for raid in raids]
        over = np.array(ended_raid) | (core.time_s > LONGEST_S)
        if not over.any():
            return asked
        ended += self._totals(self.batch.tallies.flat_totals(), over)
        self._close(over, answers)
        self.batch.reset(learners=np.repeat(over, BOATS))
        self._restart(over)
        return np.union1d(asked[~over[asked]], self.team.advance(np.flatnonzero(over))).astype(np.int64)

    def _close(self, over: BoolArray, answers: list[list[Answer]]) -> None:
        """End the answers of games that are over."""
        for game in np.flatnonzero(over):
            one = self._open[game]
            if one is not None:
                answers[game].append(one)
            self._open[game] = None

    def _restart(self, over: BoolArray) -> None:
        """Begin the raids of games that began anew, against the opponents that they were recorded from."""
        if not over.any():
            return
        self.team.restart(over, 0)
        self.pool.playing[over] = self._begun.moments.opponent[self._begun.drawn[over]]
        for game in np.flatnonzero(over):
            self._begun.remind(self.team.raids[game], int(game))

    def _totals(self, episodes: Any, over: BoolArray) -> list[dict[str, float]]:
        counts = {name: np.reshape(episodes[name], (over.size, -1)) for name in COUNTS}
        return [
            {name: float(one[game].sum() if name == "hits" else one[game, 0]) for name, one in counts.items()}
            for game in np.flatnonzero(over)
        ]

    def _evaluate(self) -> dict[str, Any]:
        """Games against held-out opponents, and the best kept."""
        network = self.network()
        write_weights(network, self.folder / FINAL)
        found = evaluation_of(self.settings, network)
        self._best = keep_best(found, self._best, network, self.folder / BEST)
        return found


def _means(games: list[dict[str, float]]) -> dict[str, Any]:
    means = {name: float(np.mean([one[name] for one in games])) if games else None for name in COUNTS}
    return {"games": len(games), **means}


def _checked(settings: TrainingSettings, resume: bool) -> dict[str, Any]:
    """The options with defaults.

    Raises:
        ConfigError: see `RaidsTraining`.
    """
    for name in settings.options:
        if name not in DEFAULTS:
            raise ConfigError(f"unknown option {name!r} of raids; {near(str(name), DEFAULTS)}")
    if resume:
        raise ConfigError("raids begin anew; leave out --resume")
    if settings.game(settings.stages[0]).team_size != BOATS:
        raise ConfigError(f"raids are for teams of {BOATS} boats; leave out team_size")
    found = {**DEFAULTS, **settings.options}
    number("options.spread", found["spread"], 1e-3, 10.0)
    number("options.furthest", found["furthest"], 1e-6, 10.0)
    for name, size in (("recorded", None), ("shares", len(KINDS))):
        _numbers(f"options.{name}", found[name], size)
    return found


def _numbers(name: str, values: Any, size: int | None) -> None:
    """Refuse what is no list of numbers from 0, one of them above.

    Raises:
        ConfigError: it is something else.
    """
    if not isinstance(values, (list, tuple)) or not values or size not in (None, len(values)):
        raise ConfigError(f"{name} is {values!r}; give a list of {size or 'some'} numbers")
    for one in values:
        number(name, one, 0.0, 10.0)
    if size is not None and not any(values):
        raise ConfigError(f"{name} is {values!r}; give one above 0")
