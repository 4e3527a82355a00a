"""Raids that learn: PPO over the numbers of a scripted raid, in games that begin where raids go to their next phase."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.entrants.learned.raids import BOATS, SEEN, RaidsBatch
from steerclear.policies.entrants.learned.weights_file import read_weights, write_weights
from steerclear.policies.entrants.undertow.raid import Phase
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray

from .config import RaidsConfig
from .env import TrainEnv
from .raid_starts import BeginInRaids, StartStates, recorded
from .raids_learner import NONE, Answer, RaidsLearner
from .training import FINAL, Notice, Training, card_of, means, threads

LONGEST_S = 100.0
"""Time until a game that began in a raid is over, s."""
RECORDED_SEED = 810_000
"""First seeds of the games that moments are recorded from are multiples of it."""
COUNTS = ("captures", "captures_against", "grabs", "grabs_against", "hits")


class RaidsTraining(Training):
    """A training of raids in a folder; checkpoints are not kept: it begins anew.

    Args:
        config: what it is to be; a decision is one of a team.
        folder: where everything goes.
        resume: refused.

    Raises:
        ConfigError: teams not of three boats, ``resume``, or a setting that cannot be.
    """

    def __init__(self, config: RaidsConfig, folder: Path, resume: bool = False) -> None:
        if resume:
            raise ConfigError("raids begin anew; leave out --resume")
        if config.game(config.stages[0]).team_size != BOATS:
            raise ConfigError(f"raids are for teams of {BOATS} boats; leave out team_size")
        super().__init__(config, folder)
        self.env = TrainEnv(config.model_copy(update={"interval": 1}))
        self.batch, self.pool = self.env.batch, self.env.batch.opponent
        self.batch.actions = "continuous"
        self.team = RaidsBatch(Network([], [], NONE, "tanh", "raids", config.interval, SEEN))  # is never asked
        self._all = np.arange(config.games)
        self._open: list[Answer | None] = [None] * config.games
        self.learner = RaidsLearner(config)
        if config.start:
            self.learner.begin_with(read_weights(config.start))

    def run(self, notice: Notice = lambda done, words: None) -> None:
        """Record, learn, write; what is interrupted keeps all up to the last whole rollout."""
        self._begin(notice)
        with threads(self.config.threads):
            try:
                while self.decisions < self.total:
                    notice(self.decisions, self._iterate())
            finally:
                write_weights(self.network(), self.folder / FINAL)
                self.write_curve(self.curve)
        self.write_last()

    def network(self) -> Network:
        """The actor as it is now."""
        return self.learner.network(card_of(self.config))

    def _begin(self, notice: Any) -> None:
        """Record moments, and begin games at them."""
        seed, found = self.config.seed, []
        for part, spread in enumerate(self.config.options.recorded, start=1):
            found += recorded(self.config, spread, part * RECORDED_SEED + seed)
            notice(0, f"moments recorded in {part * self._all.size} games")
        core, shares = self.batch.core, self.config.options.shares
        self._begun = BeginInRaids(core, StartStates.of(found, shares), shares, seed)
        self.env.play_as_stage_says()
        self.batch.reset(seed)
        self.team.reset(core, 0, seed)
        self._restart(np.ones(core.n_games, np.bool_))

    def _iterate(self) -> str:
        """A rollout and what is learned from it; words for people."""
        began = time.perf_counter()
        answers, games = self._rollout()
        played = time.perf_counter()
        told = self.learner.learn(answers)
        row = {"decisions": self.decisions, **means(games, COUNTS), **told}
        row["wall"] = {"playing_s": played - began, "learning_s": time.perf_counter() - played}
        self.curve.append(row)
        if len(self.curve) % self.config.evaluation.every == 0 or self.decisions >= self.total:
            row["evaluation"] = self.evaluate()
            self.write_curve(self.curve)
        return f"captures {row['captures'] or 0.0:.2f}, against {row['captures_against'] or 0.0:.2f} a raid"

    def _rollout(self) -> tuple[list[list[Answer]], list[dict[str, float]]]:
        """Answers of each game in order, and totals of games that ended."""
        answers: list[list[Answer]] = [[] for _ in self._all]
        ended: list[dict[str, float]] = []
        for _ in range(self.config.ppo.steps):
            asked = self.team.advance(self._all)
            self._answer(self._renewed(asked, answers, ended), answers)
            earned, over = self._decide(ended)
            for game, one in enumerate(self._open):
                if one is not None:
                    one.earned += earned[game] * self.config.ppo.discount**one.decisions
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
        self.team.aim(self._all, self.config.interval)
        for _ in range(self.config.interval):
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
