"""Opponents from a pool: each game of a batch has one of them, drawn by the league's matching rule."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from steerclear import policies
from steerclear.policies.entrants.learned import LearnedBatch
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.registry import plays_batches
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array, BoolArray

from .each_game import EachGame
from .settings import SELF, League, Stage

LAST = 50
"""Games that a mean score is over."""


def opponent_of(name: str, every: int = 1) -> Any:
    """The batch policy of a name: those that play batches do, others play one game after another.

    Args:
        name: of the policy.
        every: game steps between two questions to one that plays one game after another.

    Raises:
        PolicyError: there is none.
    """
    if plays_batches(name):
        return policies.make_batch(name)
    policies.check(name)
    return EachGame(name, every)


class Pool:
    """A `BatchPolicy` made of several. A game keeps its opponent to its end, also a snapshot that is no longer drawn.

    Args:
        stage: whose opponents they are, and how long they wait between tags; "self" among them stands for the snapshots
            added by `add_snapshot`.
        league: the matching rule and how many snapshots are kept.
        seed: of the draws.
        every: game steps between two questions to members that play one game after another.
    """

    def __init__(self, stage: Stage, league: League, seed: int, every: int = 1) -> None:
        names = stage.opponents
        self.name = ",".join(names)
        self.league = league
        self.stage = stage
        self.members = {name: opponent_of(name, every) for name in names if name != SELF}
        self.learns = SELF in names
        if not self.members and not self.learns:
            raise PolicyError("the pool of opponents is empty; name one at least")
        self.scores: dict[str, deque[float]] = {name: deque(maxlen=LAST) for name in self.members}
        self._rng = np.random.default_rng([seed, 77])
        self._core: Any = None

    def add_snapshot(self, network: Network, number: int) -> None:
        """Add the learner as it is; the oldest snapshot is drawn no more where there are too many."""
        name = f"{SELF}_{number}"
        ours = [one for one in self.scores if one.startswith(f"{SELF}_")]
        if len(ours) >= self.league.keep:
            del self.scores[ours[0]]
            self._forget_unused()
        self.members[name] = LearnedBatch(network, name, sample=network.kind == "discrete")
        self.scores[name] = deque(maxlen=LAST)
        if self._core is not None:
            self.members[name].reset(self._core, self._team, self._seed)

    def _forget_unused(self) -> None:
        """Let go of snapshots that are not drawn any more and that no game plays against."""
        still = set(self.scores) | (set() if self._core is None else set(self.playing))
        self.members = {name: member for name, member in self.members.items() if name in still}

    def reset(self, core: Any, team: int, seed: int) -> None:
        """Begin all games."""
        self._core, self._team, self._seed = core, team, seed
        for member in self.members.values():
            member.reset(core, team, seed)
        self.playing = np.array([self._draw() for _ in range(core.n_games)], dtype=object)
        self.waits_s = self._waits(core.n_games)
        self._out = np.zeros((core.n_games, int(np.sum(core.team == team)), 2))

    def _waits(self, games: int) -> Array:
        """Times between tags, s, of so many games (games,)."""
        cooldown_s = self.stage.cooldown_s or 0.0
        return self._rng.uniform(*cooldown_s, games) if isinstance(cooldown_s, tuple) else np.full(games, cooldown_s)

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Begin the chosen games (B,) anew, each with an opponent drawn anew."""
        for member in self.members.values():
            member.restart(chosen, seed)
        for game in np.flatnonzero(chosen):
            self.playing[game] = self._draw()
        self._forget_unused()
        self.waits_s[chosen] = self._waits(int(np.sum(chosen)))

    def act(self, core: Any, team: int) -> Array:
        """Commands (B, n_team, 2); the array is reused by the next call."""
        if self.stage.cooldown_s is not None:
            hold_back(core, team, self.waits_s)
        for name, member in self.members.items():
            mine = self.playing == name
            if mine.any():
                if hasattr(member, "plays"):
                    member.plays(mine)
                self._out[mine] = member.act(core, team)[mine]
        return self._out

    def ended(self, core: Any, games: BoolArray) -> None:
        """Note how the learner did in games (B,) that have ended."""
        for game in np.flatnonzero(games):
            own, foe = core.captures[game, 1 - self._team], core.captures[game, self._team]
            score = 0.5 + 0.5 * float(np.sign(own - foe))
            if self.playing[game] in self.scores:
                self.scores[self.playing[game]].append(score)

    def weights(self) -> dict[str, float]:
        """Each member's weight in the draw."""
        means = {name: float(np.mean(scores)) if scores else 0.5 for name, scores in self.scores.items()}
        return {name: (1.0 - mean) ** self.league.power + self.league.floor for name, mean in means.items()}

    def _draw(self) -> str:
        weights = self.weights()
        share = np.array(list(weights.values()))
        return str(self._rng.choice(list(weights), p=share / share.sum()))


def hold_back(core: Any, team: int, cooldown_s: Array) -> None:
    """Slow the clocks that a team's boats recharge by, so that a whole cool-down takes ``cooldown_s`` (B,).

    Boats see the share of the cool-down that is over, so what they see means the same.
    """
    boats = np.flatnonzero(core.team == team)
    elapsed_s, whole_s = core.tagging_cooldown_s, core.config.tagging_cooldown_s
    share = np.minimum(1.0, whole_s / np.maximum(cooldown_s, 1e-9))[:, None]
    rests = (elapsed_s[:, boats] > 0.0) & (elapsed_s[:, boats] < whole_s)
    elapsed_s[:, boats] -= rests * (1.0 - share) * core.config.decision_s
