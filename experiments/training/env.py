"""`TrainEnv`: the games of a training as a vector environment of Stable-Baselines3, one stage at a time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from steerclear.env.core import BatchedMctf
from steerclear.policies.entrants.learned.network import Network
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L
from steerclear.shield.shared import share
from steerclear.shield.wrappers import MctfVecEnv, TeamBatch, games_shield
from steerclear.shield.wrappers.game_facts import facts_of_games
from steerclear.shield.wrappers.tallies import OWN_EVENTS
from steerclear.shield.wrappers.team_batch import Stepped

from .config import Config, Stage
from .opponents import Pool
from .rewards import WeightedSum


def core_of(config: Config, games: int, seed: int, stage: Stage | None = None) -> BatchedMctf:
    """Return games by the rules of a stage, or of evaluations; ``seed`` draws their starts."""
    return BatchedMctf(config.game(stage), n_games=games, seed=seed)


def shield_of(config: Config, core: BatchedMctf, team: str = "blue", stage: Stage | None = None) -> Any:
    """Return a config's shield for the games of a stage, or of evaluations."""
    settings = ShieldConfig.of(**{**facts_of_games(core).settings(), **config.shield_of(stage)})
    return games_shield(core, settings, team=team, threads=config.shield_threads)


def pool_of(config: Config, stage: Stage) -> Pool:
    """Return the opponents of a stage."""
    return Pool(stage, config.league, config.seed, config.entrants_every)


def set_tags(core: BatchedMctf, stage: Stage) -> None:
    """Set the games' tag probability to the stage's, or to the rules' if it has none."""
    chance = core.config.tag_probability if stage.tag_probability is None else stage.tag_probability
    core.rules = share(core.rules._replace(tag_probability=float(chance)))


class AskedShield:
    """Calls a batch's command filter in the first game step of a decision and every ``every`` steps after it.

    In between, the filtered command is held as course and speed, with no guarantee: the shield then only teaches.
    Evaluations filter in every game step.

    Attributes:
        spent_s: time spent in the filter, s.
    """

    def __init__(self, batch: TeamBatch, every: int) -> None:
        self._ask, self._boats, self._every = batch._filter, batch.boats, every
        self.moved, self.spent_s = 0, 0.0
        batch._filter = self

    def __call__(self, core: Any, commands: Array) -> Array:
        """Return the filtered commands (B, n, 2)."""
        began = time.perf_counter()
        heading_deg = core.state[:, self._boats, L.HEADING]
        if self.moved % self._every == 0:
            answer = np.array(self._ask(core, commands))
            self._speed_mps = answer[:, self._boats, 0].copy()
            self._course_deg = heading_deg + answer[:, self._boats, 1]
        else:
            answer = np.array(commands)
            answer[:, self._boats, 0] = self._speed_mps
            answer[:, self._boats, 1] = (self._course_deg - heading_deg + 180.0) % 360.0 - 180.0
        self.moved += 1
        self.spent_s += time.perf_counter() - began
        return answer


class TrainEnv(MctfVecEnv):
    """Every blue boat of every game is a learner; opponents, rewards, shield and rules are the stage's.

    Unless the network's roles are shared, observations end in the boat's place in the team, one-hot. With ``first``,
    that network decides while no teammate holds the flag. The learner's actions then have no effect, so their expected
    gradient is zero.

    Attributes:
        batch: games of the current stage.
        stage: its number.
        spent_s: time spent in the games, s, shield included.
        first: that network, set up to see who holds the flag; None: the learner always decides.
    """

    def __init__(self, config: Config, first: Network | None = None) -> None:
        self.config, self.stage = config, 0
        self.spent_s, self._ended = 0.0, []  # type: float, list[dict[str, float]]
        self.batch = self._games(0)
        self._check_stages()
        super().__init__(self.batch)
        core, boats = self.batch.core, len(self.batch.boats)
        if first is not None and (first.n_obs, first.interval) != (core.n_obs, config.interval):
            raise ConfigError("the network that plays first learned in other games; begin anew in another --out")
        self.first = None if first is None else replace(first, carriers=carriers_of(core))
        told = config.net.roles != "shared"
        self._places = np.tile(np.eye(boats, dtype=np.float32), (core.n_games, 1)) if told else None
        if told:
            self.observation_space = Box(-1.0, 1.0, (core.n_obs + boats,), np.float32)

    def _games(self, number: int) -> TeamBatch:
        config, stage = self.config, self.config.stages[number]
        core = core_of(config, config.games, config.seed, stage)
        shield = shield_of(config, core, stage=stage) if config.shield != "none" else None
        batch = TeamBatch(
            core,
            pool_of(config, stage),
            shield=shield if config.shielded_training else None,
            actions=config.actions,
            seed=config.seed,
            interval=config.interval,
            reward=WeightedSum(config.reward_weights(stage)),
        )
        asked = AskedShield(batch, config.shield_every) if config.shielded_training else None
        self._guard = (batch.shield, asked)
        return batch

    def _check_stages(self) -> None:
        """Build every pool and reward once, so that errors show before the training starts."""
        seen = core_of(self.config, 1, 0).observation_high
        for stage in self.config.stages:
            pool_of(self.config, stage)
            WeightedSum(self.config.reward_weights(stage))
            if stage.rules and not np.array_equal(core_of(self.config, 1, 0, stage).observation_high, seen):
                raise ConfigError(
                    f"rules {dict(stage.rules)!r} of a stage change what boats see or its bounds (field, teams, "
                    "obstacles, top speed of the fastest boat, scores, cool-down); leave those as in the training's "
                    "rules"
                )
        for name in self.config.evaluation.opponents:
            Pool(Stage(opponents=(name,)), self.config.league, 0)

    def enter(self, number: int) -> None:
        """Switch to a stage, with new games if its rules or shield differ; `begin` starts them."""
        before, stage = self.config.stages[self.stage], self.config.stages[number]
        self.stage = number
        same_shield = self.config.shield_of(before) == self.config.shield_of(stage)
        if self.config.game(stage) == self.batch.core.config and same_shield:
            self.batch.opponent = pool_of(self.config, stage)
        else:
            self.batch = self._games(number)

    def begin(self, seed: int) -> Any:
        """Start all games of the stage and return the observations.

        Clocks are advanced by random times, so that games do not all end in the same step.
        """
        self.play_as_stage_says()
        self.batch._seed = seed
        seen = self.reset()
        core = self.batch.core
        decision_s = core.config.decision_s * self.batch.interval
        latest = max(1, int(0.9 * core.config.max_time_s / decision_s))
        core.time_s[:] = np.random.default_rng([seed, 5]).integers(0, latest, core.n_games) * decision_s
        return seen

    def play_as_stage_says(self) -> None:
        """Apply the stage's tag probability, shield and rewards to the games."""
        stage, batch = self.config.stages[self.stage], self.batch
        set_tags(batch.core, stage)
        batch.shield, batch._filter = self._guard if stage.shielded else (None, None)
        batch.reward = WeightedSum(self.config.reward_weights(stage))
        batch.reward.begin(batch, np.ones(batch.core.n_games, np.bool_))

    def reset(self) -> Any:
        """Reset as `MctfVecEnv.reset`, with places added."""
        return self._placed(super().reset())

    def decide(self, actions: Any) -> Stepped:
        """Play one decision of all learners, held for the config's interval."""
        began = time.perf_counter()
        if self._guard[1] is not None:
            self._guard[1].moved = 0
        out = self.batch.step(actions if self.first is None else self._by_first(self.first, actions))
        done, boats = out.terminated | out.truncated, len(self.batch.boats)
        for game in np.flatnonzero(done[::boats]) * boats:
            whole = {name: float(np.sum(out.episodes[name][game : game + boats])) for name in OWN_EVENTS}
            self._ended.append({name: float(totals[game]) for name, totals in out.episodes.items()} | whole)
        self.spent_s += time.perf_counter() - began
        return out

    def step_wait(self) -> Any:
        """Step as `MctfVecEnv.step_wait`, with places added."""
        out = self.decide(self._actions)
        began, done = time.perf_counter(), out.terminated | out.truncated
        infos = self._infos(out, done)
        for i in np.flatnonzero(done) if self._places is not None else ():
            last = infos[i]["terminal_observation"]
            infos[i]["terminal_observation"] = np.concatenate([last, self._places[i]])
        seen, rewards = self._placed(out.observations), out.rewards.astype(np.float32)
        self.spent_s += time.perf_counter() - began
        return seen, rewards, done, infos

    def _placed(self, observations: Any) -> Any:
        return observations if self._places is None else np.concatenate([observations, self._places], axis=1)

    def _by_first(self, first: Network, actions: Any) -> Any:
        seen = self.batch.core.observations[:, self.batch.boats].reshape(self.batch.learners, -1)
        places = np.arange(len(seen)) % len(self.batch.boats)
        return np.where(first.held(seen), actions, first.outputs(seen, places).argmax(axis=1))

    def ended(self) -> list[dict[str, float]]:
        """Return totals of games ended since the last call; hits and interventions are summed over the team."""
        games, self._ended = self._ended, []
        return games

    def taken(self) -> dict[str, float]:
        """Return time spent since the last call, s: simulator with opponents and rewards; and shield."""
        shield_s = 0.0
        if self._guard[1] is not None:
            shield_s, self._guard[1].spent_s = self._guard[1].spent_s, 0.0
        games_s, self.spent_s = self.spent_s, 0.0
        return {"simulator_s": games_s - shield_s, "shield_s": shield_s}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the live arrays that persist between decisions: games, counts, rewards, shield and opponents."""
        batch = self.batch
        found = dict(_arrays_in(batch.core.games, "games")) | {"observations": batch.core.observations}
        found |= dict(_arrays_in(batch.tallies, "tallies"))
        for name, term in batch.reward.terms.items():
            found |= dict(_arrays_in(term, f"reward/{name}"))
        if batch.shield is not None:
            found |= {f"shield/{name}": values for name, values in batch.shield.remembered.items()}
        for name, member in batch.opponent.members.items():
            if not hasattr(member, "plays"):  # members that play game by game start anew instead
                found |= dict(_arrays_in(member, f"opponent/{name}"))
        return found

    def put(self, saved: dict[str, np.ndarray], seed: int, pool: dict[str, Any], snapshots: Any) -> None:
        """Restore this stage from a checkpoint: `arrays`, the batch's seed and `Pool.facts`.

        ``snapshots`` reads the network of a snapshot by its name.
        """
        self.play_as_stage_says()
        self.batch.opponent.remember(pool["members"], snapshots)
        self.batch.reset(seed)
        self.batch.opponent.put(pool)
        for name, live in self.arrays().items():
            if name not in saved or saved[name].shape != live.shape:
                raise ConfigError(f"the checkpoint holds other {name}; resume with the config it was made with")
            live[...] = saved[name]


def carriers_of(core: BatchedMctf) -> np.ndarray:
    """Return the observation indices that tell which boat of the own team holds the flag."""
    keys = [key if isinstance(key, str) else "/".join(key) for key in core.observation_keys]
    own = [k for k, key in enumerate(keys) if key.endswith("has_flag") and not key.startswith("opponent")]
    return np.array(own, np.int64)


def _arrays_in(thing: Any, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the live arrays of an object or named tuple, by name."""
    items = zip(thing._fields, thing, strict=True) if hasattr(thing, "_fields") else sorted(vars(thing).items())
    for key, value in items:
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            yield f"{name}/{key}", value
        elif hasattr(value, "_fields"):
            yield from _arrays_in(value, f"{name}/{key}")
