"""Training of raids: PPO (Schulman et al. 2017) over the parameters of a scripted raid, each held for a time.

Games start from recorded states in which a scripted raid enters a phase or takes the flag. Starts nearer to a capture
end in one more often; from regular starts almost no step shows how to bring a flag home (Salimans and Chen, "Learning
Montezuma's Revenge from a Single Demonstration", 2018).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from steerclear.policies.entrants.learned.network import Features, Network, read_weights, write_weights
from steerclear.policies.entrants.learned.raids import BOATS, SEEN, RaidsBatch
from steerclear.policies.entrants.undertow.raid import Phase, Raid
from steerclear.policies.entrants.undertow.shape import NAMES
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import layout as L
from torch import nn

from ..words import count_text
from .config import Config
from .env import TrainEnv, core_of, pool_of, set_tags, shield_of
from .opponents import Pool
from .policy import ACTIVATIONS, numbers_of
from .training import FINAL, DivergedError, Notice, Training, card_of, device_of, means, threads

PLACE = (
    *("state", "previous_position", "error_is_float32", "is_tagged", "is_disabled", "has_flag", "oob", "on_side"),
    *("driven", "tagging_cooldown_s", "touching", "contact", "flag_position", "flag_taken"),
)
"""Arrays that define a game's state; clocks, scores and random numbers are the new game's own."""
TURNED = (L.RUDDER, L.HEADING_ERROR, L.HEADING_INTEGRAL, L.TURN_RATE)
"""Entries of a boat's state that change sign when mirrored."""
KINDS = ("bait", "drag", "run", "flag", "alone", "alone_flag")
"""Kinds of start states: phase that the raid enters, or "flag" once taken; the last two if the flag is unguarded."""
LONGEST_S = 100.0
"""Game time after which a game that began in a raid is ended, s."""
RECORDED_SEED = 810_000
"""Seed offset between the sets of games that start states are recorded from."""
COUNTS = ("captures", "captures_against", "grabs", "grabs_against", "hits")
NONE = Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)
CRITIC_RATE, FIRST_GAIN = 1e-3, 1e-3
Floats = NDArray[np.float32]
Moment = tuple[dict[str, Array], list[float], int, str]
"""Start state: arrays of `PLACE`, memory of the raid, index in `KINDS`, name of the opponent."""


class Recorder(RaidsBatch):
    """Plays scripted raids with random changes of their parameters, and records start states in ``found``.

    Args:
        interval: game steps for which a decision is held.
        spread: standard deviation of the parameters, in units of `shape.LIMITS`.
        seed: of the random draws.
        pool: of the opponents.
    """

    def __init__(self, interval: int, spread: float, seed: int, pool: Pool) -> None:
        rng = np.random.default_rng([seed, 12])
        drawn: Any = SimpleNamespace(interval=interval)  # replaces a network: the script's parameters plus noise
        drawn.outputs = lambda seen, roles: spread * rng.normal(size=(len(seen), len(NAMES)))
        self.network, self.name, self._team = drawn, "recorder", -1
        self.found: list[Moment] = []
        self._pool = pool

    def _asks(self, game: int) -> bool:
        before = self._stood[game]
        asks = super()._asks(game)
        raid = self.raids[game]
        by_numbers = raid.phase > Phase.GATHER and raid.passage is None  # the raid's memory does not include a passage
        if self._stood[game] != before and by_numbers:
            place = {name: getattr(self._core.games, name)[game].copy() for name in PLACE}
            kind = KINDS.index("flag") if raid.held else raid.phase - 1
            if raid.unguarded:
                kind = KINDS.index("alone_flag" if raid.held else "alone")
            memory = raid.memory(float(self._core.time_s[game]))
            self.found.append((place, memory, kind, self._pool.playing[game]))
        return asks


def recorded(config: Config, spread: float, seed: int) -> list[Moment]:
    """Return start states from ``config.games`` games with the training's rules, shield and opponents."""
    stage = config.stages[0]
    core = core_of(config, config.games, seed, stage)
    set_tags(core, stage)
    core.reset(seed=seed)
    foe = pool_of(config.model_copy(update={"seed": seed}), stage)
    recorder = Recorder(config.interval, spread, seed, foe)
    recorder.reset(core, 0, seed)
    foe.reset(core, 1, seed + 1)
    shielded = config.shielded_training and stage.shielded
    command_filter = shield_of(config, core, stage=stage).filter_for(0) if shielded else None
    commands = np.zeros((core.n_games, core.n_boats, 2))
    own, others = np.flatnonzero(core.team == 0), np.flatnonzero(core.team == 1)
    while not (core.terminated | core.truncated).all():
        commands[:, own], commands[:, others] = recorder.act(core, 0), foe.act(core, 1)
        core.step(commands, command_filter)
    return recorder.found


class BeginInRaids:
    """Replaces a core's ``reset``: games begin from recorded start states, half of them mirrored.

    Args:
        core: the games.
        moments: start states to draw from.
        shares: relative frequency of each of `KINDS`.
        seed: of the random draws.

    Attributes:
        drawn: (B,) index of each game's start state.
        mirrored: (B,) whether it was mirrored.

    Raises:
        ConfigError: a kind with a share has no start state.
    """

    def __init__(self, core: Any, moments: Sequence[Moment], shares: Sequence[float], seed: int) -> None:
        kinds = np.array([moment[2] for moment in moments])
        self._of_kind = [np.flatnonzero(kinds == number) for number in range(len(KINDS))]
        for name, share, some in zip(KINDS, shares, self._of_kind, strict=True):
            if share and not some.size:
                raise ConfigError(
                    f"no raid came to {name!r} in the games recorded; give more games, longer ones (max_time_s), or 0 "
                    "as its share (options.shares)"
                )
        self._core, self._reset, self.moments = core, core.reset, moments
        self._shares = np.array(shares) / np.sum(shares)
        self._rng = np.random.default_rng([seed, 11])
        self.drawn, self.mirrored = np.zeros(core.n_games, np.int64), np.zeros(core.n_games, np.bool_)
        core.reset = self

    def __call__(self, mask: BoolArray | None = None, seed: int | None = None) -> Any:
        """Reset games like `BatchedMctf.reset`, then set their start states."""
        self._reset(mask=mask, seed=seed)
        for game in np.flatnonzero(np.ones(self._core.n_games, np.bool_) if mask is None else mask):
            fit = self._of_kind[self._rng.choice(len(KINDS), p=self._shares)]
            self.drawn[game] = fit[self._rng.integers(fit.size)]
            for name, array in self.moments[self.drawn[game]][0].items():
                getattr(self._core.games, name)[game] = array
            self.mirrored[game] = self._rng.random() < 0.5
            if self.mirrored[game]:
                mirror(self._core, game)
        return self._core.observe()

    def remind(self, raid: Raid, game: int) -> None:
        """Restore a raid's memory from the start state of its game."""
        memory = self.moments[self.drawn[game]][1]
        raid.remember(memory, float(self._core.time_s[game]), bool(self.mirrored[game]))

    def opponent(self, game: int) -> str:
        """Return the opponent that a game's start state was recorded against."""
        return self.moments[self.drawn[game]][3]


def mirror(core: Any, game: int) -> None:
    """Swap south and north in a game."""
    games, height_m = core.games, core.config.env_bounds_m[1]
    state = games.state[game]
    state[:, L.Y] = height_m - state[:, L.Y]
    state[:, L.HEADING] = (360.0 - state[:, L.HEADING]) % 360.0 - 180.0
    state[:, TURNED] *= -1.0
    games.previous_position[game, :, 1] = height_m - games.previous_position[game, :, 1]
    games.flag_position[game, :, 1] = height_m - games.flag_position[game, :, 1]


@dataclass
class Answer:
    """A network's decision and its outcome until the next one.

    Attributes:
        seen: (n,) observation.
        units: (k,) sampled action.
        chance: its log density.
        earned: discounted reward until the next decision.
        decisions: team decisions until then.
        after: next observation; None: the game, or the raid that it began with, was over.
    """

    seen: Floats
    units: Floats
    chance: float
    earned: float = 0.0
    decisions: int = 0
    after: Floats | None = None


class RaidsLearner:
    """Actor and critic; actions are Gaussian around the actor's output, in units of `shape.LIMITS`."""

    def __init__(self, config: Config) -> None:
        torch.manual_seed(config.seed)
        self._config, self._learned = config, 0
        self._device = device_of(config.device)
        self._rng = np.random.default_rng([config.seed, 21])
        self.actor, self.critic = _network(config, len(NAMES)), _network(config, 1)
        self.spread = nn.Parameter(torch.full((len(NAMES),), float(np.log(config.options.spread))))
        for part in (self.actor, self.critic):
            part.to(self._device)
        rate = config.ppo.learning_rate
        self._optimiser = torch.optim.Adam([*self.actor.parameters(), self.spread], lr=rate, eps=1e-5)
        self._critics = torch.optim.Adam(self.critic.parameters(), lr=CRITIC_RATE, eps=1e-5)

    def begin_with(self, network: Network) -> None:
        """Copy the weights of a network of the same shape into the actor."""
        layers = [layer for layer in self.actor if isinstance(layer, nn.Linear)]
        shapes = [tuple(reversed(layer.weight.shape)) for layer in layers]
        if [weight.shape for weight in network.weights] != [(1, *shape) for shape in shapes]:
            raise ConfigError(f"start does not fit this network of layers {shapes}; give its own net settings")
        with torch.no_grad():
            for layer, weight, bias in zip(layers, network.weights, network.biases, strict=True):
                layer.weight.copy_(torch.as_tensor(weight[0].T))
                layer.bias.copy_(torch.as_tensor(bias[0]))

    def answers(self, seen: Floats) -> list[Answer]:
        """Sample decisions for observations (N, n)."""
        with torch.no_grad():
            mean, spread = self.actor(self._tensor(seen)).cpu().numpy(), self.spread.exp().cpu().numpy()
        noise = self._rng.normal(size=mean.shape)
        units = (mean + spread * noise).astype(np.float32)
        chances = (-0.5 * noise**2 - np.log(spread)).sum(axis=1)
        return [Answer(*one) for one in zip(seen, units, chances.tolist(), strict=True)]

    def learn(self, games: Sequence[Sequence[Answer]]) -> dict[str, float]:
        """Update from a rollout's decisions, given per game in order; return figures for the curve."""
        answers = [answer for game in games for answer in game]
        seen = self._tensor(np.stack([one.seen for one in answers]))
        units = self._tensor(np.stack([one.units for one in answers]))
        chances = self._tensor(np.array([one.chance for one in answers], np.float32))
        gains, values = self._gains(games, answers, seen)
        wanted, gain = self._tensor(gains + values), self._tensor((gains - gains.mean()) / (gains.std() + 1e-8))
        ppo, further, far = self._config.ppo, self._learned >= self._config.ppo.critic_first, [0.0]
        for _ in range(ppo.epochs):
            for some in torch.as_tensor(self._rng.permutation(len(answers))).split(ppo.batch):
                self._step(self._critics, ((self.critic(seen[some])[:, 0] - wanted[some]) ** 2).mean())
                if further:
                    far.append(self._improve(seen[some], units[some], chances[some], gain[some]))
            further = further and float(np.mean(far[-3:])) <= self._config.options.furthest
        self._learned += 1
        spread = float(self.spread.detach().exp().mean())
        explained = 1.0 - float(np.mean(gains**2) / (np.var(gains + values) + 1e-9))
        return {"answers": len(answers), "explained": explained, "divergence": far[-1], "spread": spread}

    def _gains(self, games: Any, answers: Sequence[Answer], seen: Any) -> tuple[Floats, Floats]:
        """Return advantages (GAE, for decisions of different lengths) and values of all decisions."""
        ppo = self._config.ppo
        after = self._tensor(np.stack([one.seen if one.after is None else one.after for one in answers]))
        with torch.no_grad():
            values, later = (self.critic(told)[:, 0].cpu().numpy() for told in (seen, after))
        gains, at = np.zeros(len(answers), np.float32), len(answers)
        for game in reversed(games):
            last = 0.0
            for one in reversed(game):
                at -= 1
                left = 0.0 if one.after is None else ppo.discount**one.decisions
                last = one.earned + left * later[at] - values[at] + left * ppo.gae_lambda * last
                gains[at] = last
        return gains, values

    def _improve(self, seen: Any, units: Any, chances: Any, gain: Any) -> float:
        """Update the actor once; return the approximate KL divergence from the sampling policy."""
        ppo = self._config.ppo
        now = (-0.5 * ((units - self.actor(seen)) / self.spread.exp()) ** 2 - self.spread).sum(1)
        ratio = torch.exp(now - chances)
        kept = torch.minimum(ratio * gain, ratio.clamp(1.0 - ppo.clip, 1.0 + ppo.clip) * gain)
        self._step(self._optimiser, -kept.mean() - ppo.entropy * self.spread.sum())
        return float((ratio - 1.0 - (now - chances)).mean().detach())

    def _step(self, optimiser: Any, loss: Any) -> None:
        if not torch.isfinite(loss):
            raise DivergedError("ppo.learning_rate")
        optimiser.zero_grad()
        loss.backward()
        for group in optimiser.param_groups:
            nn.utils.clip_grad_norm_(group["params"], self._config.ppo.max_grad_norm)
        optimiser.step()

    def _tensor(self, numbers: Any) -> Any:
        return torch.as_tensor(np.asarray(numbers, np.float32), device=self._device)

    def network(self, card: dict[str, Any]) -> Network:
        """Return the actor as a numpy network."""
        config = self._config
        return Network(*numbers_of(self.actor), NONE, config.net.activation, "raids", config.interval, SEEN, card)


def _network(config: Config, outputs: int) -> nn.Sequential:
    """Build the layers; the last starts near zero, so that raids start as the script's."""
    found: list[nn.Module] = []
    for before, after in pairwise((SEEN, *config.net.hidden, outputs)):
        found += [nn.Linear(before, after), ACTIVATIONS[config.net.activation]()]
        nn.init.orthogonal_(found[-2].weight, 2.0**0.5)
        nn.init.zeros_(found[-2].bias)
    nn.init.orthogonal_(found[-2].weight, FIRST_GAIN)
    return nn.Sequential(*found[:-1])


class RaidsTraining(Training):
    """Training of raids in a folder; one decision is a team's. It writes no checkpoints and cannot be resumed."""

    def __init__(self, config: Config, folder: Path, resume: bool = False) -> None:
        if config.game(config.stages[0]).team_size != BOATS:
            raise ConfigError(f"raids are for teams of {BOATS} boats; leave out team_size")
        super().__init__(config, folder)
        self.env = TrainEnv(config.model_copy(update={"interval": 1}))
        self.batch, self.pool = self.env.batch, self.env.batch.opponent
        self.batch.actions = "continuous"
        self.team = RaidsBatch(Network([], [], NONE, "tanh", "raids", config.interval, SEEN))  # network is never used
        self._all = np.arange(config.games)
        self._open: list[Answer | None] = [None] * config.games
        self.learner = RaidsLearner(config)
        if config.start:
            self.learner.begin_with(read_weights(config.start))

    def run(self, notice: Notice = lambda done, words: None) -> None:
        """Record start states, train, and write weights; an interruption loses only the unfinished rollout."""
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
        """Return the current actor."""
        return self.learner.network(card_of(self.config))

    def _begin(self, notice: Any) -> None:
        """Record start states and start games from them."""
        seed, found = self.config.seed, []
        for part, spread in enumerate(self.config.options.recorded, start=1):
            found += recorded(self.config, spread, part * RECORDED_SEED + seed)
            notice(0, f"moments recorded in {count_text(part * self._all.size, 'game')}")
        core, shares = self.batch.core, self.config.options.shares
        self._begun = BeginInRaids(core, found, shares, seed)
        self.env.play_as_stage_says()
        self.batch.reset(seed)
        self.team.reset(core, 0, seed)
        self._restart(np.ones(core.n_games, np.bool_))

    def _iterate(self) -> str:
        """Play a rollout and learn from it; return a progress line."""
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
        """Return the decisions of each game in order, and totals of ended games."""
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
        """Let the network decide in the games that ask."""
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
        """Play one team decision in all games; return the team's reward (B,) and which games ended (B,)."""
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
        """Restart games whose raid is over or that exceed `LONGEST_S`; return the games that ask for a decision."""
        raids, core = self.team.raids, self.batch.core
        ended_raid = [raid.phase == Phase.GATHER and not raid.unguarded for raid in raids]
        over = np.array(ended_raid) | (core.time_s > LONGEST_S)
        if not over.any():
            return asked
        ended += self._totals(self.batch.tallies.flat_totals(), over)
        self._close(over, answers)
        self.batch.restart(over)
        self._restart(over)
        return np.union1d(asked[~over[asked]], self.team.advance(np.flatnonzero(over))).astype(np.int64)

    def _close(self, over: BoolArray, answers: list[list[Answer]]) -> None:
        """Complete the open decisions of games that are over."""
        for game in np.flatnonzero(over):
            one = self._open[game]
            if one is not None:
                answers[game].append(one)
            self._open[game] = None

    def _restart(self, over: BoolArray) -> None:
        """Begin the raids of restarted games, against the opponents of their start states."""
        if not over.any():
            return
        self.team.restart(over, 0)
        for game in np.flatnonzero(over):
            self.pool.playing[game] = self._begun.opponent(game)
            self._begun.remind(self.team.raids[game], int(game))

    def _totals(self, episodes: Any, over: BoolArray) -> list[dict[str, float]]:
        counts = {name: np.reshape(episodes[name], (over.size, -1)) for name in COUNTS}
        return [
            {name: float(one[game].sum() if name == "hits" else one[game, 0]) for name, one in counts.items()}
            for game in np.flatnonzero(over)
        ]
