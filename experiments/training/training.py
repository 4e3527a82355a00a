"""`Training`: rollouts, learning, curriculum, league, evaluation and checkpoints, until its decisions are made."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from steerclear.env.whole_file import whole_file
from steerclear.policies.entrants.learned import LearnedBatch
from steerclear.policies.entrants.learned.sb3_file import TAKES_OVER, add_card
from steerclear.policies.entrants.learned.weights_file import read_weights, write_weights
from steerclear.shield.exceptions import ConfigError

from ..runs.provenance import versions
from .checkpoints import checkpoints_in, read_checkpoint, write_checkpoint
from .curve import write_curve
from .games import Timed, check_sight, learners_of, set_stage, stagger
from .learner import Learner
from .playing import evaluation_of, keep_best
from .pool import Pool
from .rewards import WeightedSum
from .settings import SELF, Stage, TrainingSettings
from .state import live_arrays, pool_facts, put_arrays, put_pool, put_rng, rng_facts

BEST, FINAL, MODEL, SNAPSHOTS = "best.npz", "final.npz", "model.zip", "snapshots"
Notice = Callable[[int, str], None]
_NOT_OURS = (KeyError, ValueError, TypeError, IndexError, AttributeError, RuntimeError, OverflowError)
"""What putting back parts that are missing or of another kind raises."""


class Training:
    """A training in a folder.

    Args:
        settings: what it is to be.
        folder: where everything goes.
        resume: go on from the folder's last checkpoint.

    Attributes:
        curve: one row per rollout.
        decisions: of all boats together so far.

    Raises:
        ConfigError: an unusable setting or checkpoint.
    """

    def __init__(self, settings: TrainingSettings, folder: Path, resume: bool = False) -> None:
        self.settings, self.folder = settings, folder
        self.curve: list[dict[str, Any]] = []
        self.decisions = self.rollouts = self.stage = self.stage_began = 0
        self._best, self._wall_s = -np.inf, 0.0
        self._recent: deque[float] = deque(maxlen=settings.stages[0].games)
        self._checked_opponents()
        check_sight(settings)
        self.batch = learners_of(settings, self._pool())
        self.learner = Learner(settings, self.batch, card_of(self.settings))
        self._time_parts()
        self._begin_games()
        if resume:
            self._resume()
        self._last = self._packed()

    def run(self, notice: Notice = lambda done, words: None) -> None:
        """Train to the end; what is interrupted keeps all up to the last whole rollout."""
        before = torch.get_num_threads()
        torch.set_num_threads(self.settings.threads)
        try:
            self._make_up_for_evaluation()
            while self.decisions < self.settings.decisions:
                self._iterate()
                notice(self.decisions, self._words())
        finally:
            write_checkpoint(self.folder, self._last[0]["rollouts"], *self._last)
            write_curve(self.folder, self._last[0]["curve"], self.settings)
            torch.set_num_threads(before)
        write_weights(self.learner.network(), self.folder / FINAL)
        if not (self.folder / BEST).exists():
            write_weights(self.learner.network(), self.folder / BEST)
        with whole_file(self.folder / MODEL, ConfigError) as part:  # never without its card
            self.learner.model.save(part)
            add_card(part, {**card_of(self.settings), TAKES_OVER: self.learner.first is not None})

    def _iterate(self) -> None:
        began = time.perf_counter()
        ended = self.learner.rollout()
        played = time.perf_counter()
        parts = self._parts(played - began)
        told = self.learner.learn()
        learned = time.perf_counter()
        self.rollouts += 1
        self.decisions += self.settings.ppo.steps * self.batch.learners
        games = ended[:: len(self.batch.boats)]
        row = {"decisions": self.decisions, "stage": self.stage, **_means(games), **told}
        self._promote(games)
        self._league()
        row["wall"] = {"total_s": self._wall_s + time.perf_counter() - began, **parts, "learning_s": learned - played}
        self.curve.append(row)
        if self._due():
            self._last = self._packed()  # what was learned is kept, whatever the games of an evaluation meet
            row |= self._evaluate()
        self._wall_s += time.perf_counter() - began
        row["wall"]["total_s"] = self._wall_s
        self._last = self._packed()
        if self.rollouts % self.settings.checkpoint_every == 0:
            write_checkpoint(self.folder, self.rollouts, *self._last)
            write_curve(self.folder, self.curve, self.settings)

    def _time_parts(self) -> None:
        """Count the time in games and shield apart."""
        self._in_games = Timed(self.batch.step)
        self._in_shield = Timed(self.batch._filter) if self.batch._filter is not None else None
        self.batch.step = self._in_games
        self.batch._filter = self._in_shield
        self._guard = (self.batch.shield, self._in_shield)

    def _parts(self, rollout_s: float) -> dict[str, float]:
        """Where the time of a rollout went: simulator with opponents and rewards, shield, acting network."""
        games_s = self._in_games.taken()
        shield_s = self._in_shield.taken() if self._in_shield is not None else 0.0
        return {"simulator_s": games_s - shield_s, "shield_s": shield_s, "acting_s": rollout_s - games_s}

    def _promote(self, games: list[dict[str, float]]) -> None:
        """Go to the next stage where this one's rule is met."""
        self._recent.extend(one["captures"] - one["captures_against"] for one in games)
        stage = self.settings.stages[self.stage]
        if self.stage + 1 >= len(self.settings.stages):
            return
        full = len(self._recent) == stage.games and float(np.mean(self._recent)) >= stage.net
        if full or 0 < stage.most <= self.decisions - self.stage_began:
            self.stage, self.stage_began = self.stage + 1, self.decisions
            self._recent = deque(maxlen=self.settings.stages[self.stage].games)
            self._enter_stage()
            if self.batch.opponent.learns:
                self._add_snapshot()
            self._begin_games(self.decisions)

    def _enter_stage(self) -> None:
        """Play against a stage's opponents, in games of its own where its rules are others."""
        stage, pool = self.settings.stages[self.stage], self._pool()
        if self.settings.game(stage) == self.batch.core.config:
            self.batch.opponent = pool
            return
        self.batch = learners_of(self.settings, pool, stage)
        self.learner.play_in(self.batch)
        self._time_parts()

    def _league(self) -> None:
        if self.batch.opponent.learns and self.rollouts % self.settings.league.every == 0:
            self._add_snapshot()

    def _add_snapshot(self) -> None:
        network = self.learner.network()
        write_weights(network, self.folder / SNAPSHOTS / f"{SELF}_{self.rollouts}.npz")
        self.batch.opponent.add_snapshot(network, self.rollouts)

    def _due(self) -> bool:
        """Whether this rollout ends with an evaluation."""
        return self.rollouts % self.settings.evaluation.every == 0 or self.decisions >= self.settings.decisions

    def _make_up_for_evaluation(self) -> None:
        """Play the evaluation that an error kept from the training that is gone on with."""
        if self.curve and self._due() and "evaluation" not in self.curve[-1]:
            self.curve[-1] |= self._evaluate()
            self._last = self._packed()

    def _evaluate(self) -> dict[str, Any]:
        """Games against held-out opponents, and the best kept; the weights as they are lie there before the first."""
        network = self.learner.network()
        write_weights(network, self.folder / FINAL)
        found = evaluation_of(self.settings, network)
        self._best = keep_best(found, self._best, network, self.folder / BEST)
        return {"evaluation": found}

    def _begin_games(self, more: int = 0) -> None:
        if self.batch.opponent.learns and not self.batch.opponent.members:
            self._add_snapshot()
        self._set_stage()
        self.batch._seed = self.settings.seed + more
        self.learner.begin()
        stagger(self.batch, self.settings.seed + more)

    def _set_stage(self) -> None:
        set_stage(self.batch, self.settings, self.settings.stages[self.stage], self._guard)

    def _pool(self) -> Pool:
        settings = self.settings
        return Pool(settings.stages[self.stage], settings.league, settings.seed, settings.entrants_every)

    def _checked_opponents(self) -> None:
        """Build every pool and reward once, so that what is missing is found before long work."""
        for stage in self.settings.stages:
            WeightedSum(self.settings.reward_weights(stage))
            Pool(stage, self.settings.league, 0)
        for name in self.settings.evaluation.opponents:
            Pool(Stage((name,)), self.settings.league, 0)

    def _packed(self) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Facts and copies of arrays of this moment."""
        facts = {
            "settings": asdict(self.settings),
            "rollouts": self.rollouts,
            "decisions": self.decisions,
            "stage": self.stage,
            "stage_began": self.stage_began,
            "best": self._best if np.isfinite(self._best) else None,
            "wall_s": self._wall_s,
            "recent": list(self._recent),
            "seed": self.batch._seed,
            "pool": pool_facts(self.batch.opponent),
            "rng": rng_facts(),
            "curve": list(self.curve),
        }
        return facts, {**_copies(live_arrays(self.batch)), **self.learner.arrays()}

    def _resume(self) -> None:
        """Go on from the last whole checkpoint.

        Raises:
            ConfigError: there is none, or it is of another training.
        """
        found = checkpoints_in(self.folder)
        if not found:
            return
        facts, arrays = read_checkpoint(found[-1])
        try:
            self._check_same(facts["settings"])
            self._put_back(facts, arrays)
        except ConfigError:
            raise  # a kind of ValueError; says already what to do
        except _NOT_OURS as error:
            raise ConfigError(_not_ours(found[-1], error)) from error

    def _put_back(self, facts: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        """Go on from what `_packed` told."""
        self.rollouts, self.decisions, self.curve = facts["rollouts"], facts["decisions"], facts["curve"]
        self.stage, self.stage_began = facts["stage"], facts["stage_began"]
        self._best = -np.inf if facts["best"] is None else facts["best"]
        self._wall_s = facts["wall_s"]
        self._recent = deque(facts["recent"], maxlen=self.settings.stages[self.stage].games)
        self._enter_stage()
        self._set_stage()
        pool = self.batch.opponent
        pool.members = {name: one for name, one in pool.members.items() if name in facts["pool"]["members"]}
        for name in facts["pool"]["members"]:
            if name not in pool.members:
                network = read_weights(self.folder / SNAPSHOTS / f"{name}.npz")
                pool.members[name] = LearnedBatch(network, name, sample=network.kind == "discrete")
        self.batch.reset(facts["seed"])
        put_pool(pool, facts["pool"])
        self.learner.put(arrays)
        put_arrays(self.batch, arrays)
        put_rng(facts["rng"])

    def _check_same(self, before: dict[str, Any]) -> None:
        now = _plain(asdict(self.settings))
        for name in now:
            if name not in ("decisions", "checkpoint_every", "device") and now[name] != before.get(name):
                raise ConfigError(
                    f"{self.folder} was begun with another {name}; resume with its own config.yaml, or "
                    "name another --out"
                )

    def _words(self) -> str:
        """What the progress says: means of the games that ended in the last rollout, and its rate."""
        row = self.curve[-1]
        rate = (
            self.settings.ppo.steps
            * self.batch.learners
            / max(sum(s for name, s in row["wall"].items() if name != "total_s"), 1e-9)
        )
        stage = f"stage {self.stage + 1}/{len(self.settings.stages)}"
        if not row["games"]:
            return f"{stage}, {rate:,.0f} decisions/s"
        counts = f"captures {row['captures']:.1f}, against {row['captures_against']:.1f}, hits {row['hits']:.1f}"
        return f"{stage}, {counts} a game, {rate:,.0f} decisions/s"


def card_of(settings: TrainingSettings) -> dict[str, Any]:
    """Where the networks of a training come from, for people."""
    return {
        "trained_with": "steerclear train",
        "preset": settings.preset,
        "platform": settings.platform,
        "shield": settings.shield,
        "seed": settings.seed,
        "versions": {name: versions()[name] for name in ("steerclear", "python") if name in versions()},
    }


def _not_ours(path: Path, error: Exception) -> str:
    """What to do about a checkpoint that holds other things than this version writes."""
    why = f"{error} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())[:120]
    return (
        f"{path} is damaged or of another version ({why or type(error).__name__}); delete it to go on from the one "
        "before, or begin anew in another --out"
    )


def _plain(value: Any) -> Any:
    """As it is after a way through JSON."""
    import json

    return json.loads(json.dumps(value))


def _copies(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: np.array(value) for name, value in arrays.items()}


def _means(games: list[dict[str, float]]) -> dict[str, Any]:
    """Means of ended games, under the names of their totals."""
    names = ("r", "l", "captures", "captures_against", "grabs", "grabs_against", "tags", "tags_against", "hits")
    means = {name: float(np.mean([one[name] for one in games])) if games else None for name in names}
    return {"games": len(games), **means, "interventions": _mean_of(games, "interventions")}


def _mean_of(games: list[dict[str, float]], name: str) -> float | None:
    return float(np.mean([one[name] for one in games])) if games else None
