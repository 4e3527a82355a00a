"""A pool of opponents: each game of a batch draws one by the league's matching rule and plays it to the end."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.env.observe import observe_games  # noqa: F401 (its kernel fills the twin's observations)
from steerclear.policies.entrants.learned import LearnedBatch
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.registry import plays_batches
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import layout as L

from ..entries.team import make_team
from .config import SELF, League, Stage

LAST = 50
"""Number of latest games in a mean score."""


def opponent_of(name: str, every: int = 1) -> Any:
    """Return a batch policy by name; one that cannot play batches plays game by game, every ``every`` steps."""
    if plays_batches(name):
        return policies.make_batch(name)
    return EachGame(name, every)


class Pool:
    """A `BatchPolicy` made of several. A game keeps its opponent to the end, even a snapshot no longer drawn.

    Args:
        stage: gives the opponents and their time between tags; "self" stands for snapshots added by `add_snapshot`.
        league: matching rule and number of snapshots stored.
        seed: of the draws.
        every: game steps between calls of members that play game by game.
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
        """Add the current learner; beyond the league's limit the oldest snapshot is no longer drawn."""
        name = f"{SELF}_{number}"
        ours = [one for one in self.scores if one.startswith(f"{SELF}_")]
        if len(ours) >= self.league.keep:
            del self.scores[ours[0]]
            self._forget_unused()
        self.members[name] = self._playing(network, name)
        self.scores[name] = deque(maxlen=LAST)
        if self._core is not None:
            self.members[name].reset(self._core, self._team, self._seed)

    @staticmethod
    def _playing(network: Network, name: str) -> LearnedBatch:
        return LearnedBatch(network, name, sample=network.kind == "discrete")

    def _forget_unused(self) -> None:
        """Remove snapshots that are not drawn any more and that no game plays against."""
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
        """Draw the opponent's time between tags for each game (games,), s."""
        cooldown_s = self.stage.cooldown_s or 0.0
        return self._rng.uniform(*cooldown_s, games) if isinstance(cooldown_s, tuple) else np.full(games, cooldown_s)

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Restart the chosen games (B,), each with a newly drawn opponent."""
        for member in self.members.values():
            member.restart(chosen, seed)
        for game in np.flatnonzero(chosen):
            self.playing[game] = self._draw()
        self._forget_unused()
        self.waits_s[chosen] = self._waits(int(np.sum(chosen)))

    def act(self, core: Any, team: int) -> Array:
        """Return commands (B, n_team, 2); the next call reuses the array."""
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
        """Record the learner's results in games (B,) that have ended."""
        for game in np.flatnonzero(games):
            own, foe = core.captures[game, 1 - self._team], core.captures[game, self._team]
            score = 0.5 + 0.5 * float(np.sign(own - foe))
            if self.playing[game] in self.scores:
                self.scores[self.playing[game]].append(score)

    def weights(self) -> dict[str, float]:
        """Return each member's weight in the draw."""
        means = {name: float(np.mean(scores)) if scores else 0.5 for name, scores in self.scores.items()}
        return {name: (1.0 - mean) ** self.league.power + self.league.floor for name, mean in means.items()}

    def _draw(self) -> str:
        weights = self.weights()
        share = np.array(list(weights.values()))
        return str(self._rng.choice(list(weights), p=share / share.sum()))

    def facts(self) -> dict[str, Any]:
        """Return the state besides arrays, JSON-ready."""
        return {
            "members": list(self.members),
            "seed": self._seed,
            "playing": [str(name) for name in self.playing],
            "waits_s": self.waits_s.tolist(),
            "scores": {name: list(scores) for name, scores in self.scores.items()},
            "rng": self._rng.bit_generator.state,
        }

    def remember(self, names: Sequence[str], snapshots: Callable[[str], Network]) -> None:
        """Restore the members by name, snapshots read from file; call before `reset`."""
        self.members = {
            name: self.members[name] if name in self.members else self._playing(snapshots(name), name) for name in names
        }

    def put(self, facts: dict[str, Any]) -> None:
        """Restore what `facts` returned for a pool with the same members; call after `reset`."""
        self._seed = facts["seed"]
        self.playing[:] = facts["playing"]
        self.waits_s[:] = facts["waits_s"]
        self.scores = {name: deque(scores, maxlen=LAST) for name, scores in facts["scores"].items()}
        self._rng.bit_generator.state = facts["rng"]


def hold_back(core: Any, team: int, cooldown_s: Array) -> None:
    """Slow the tagging clocks of a team's boats, so that a whole cool-down takes ``cooldown_s`` (B,).

    Boats observe the elapsed share of the cool-down, so their observations keep their meaning.
    """
    boats = np.flatnonzero(core.team == team)
    elapsed_s, whole_s = core.tagging_cooldown_s, core.config.tagging_cooldown_s
    share = np.minimum(1.0, whole_s / np.maximum(cooldown_s, 1e-9))[:, None]
    rests = (elapsed_s[:, boats] > 0.0) & (elapsed_s[:, boats] < whole_s)
    elapsed_s[:, boats] -= rests * (1.0 - share) * core.config.decision_s


class EachGame:
    """A `BatchPolicy` around a policy for single games; slow, since each game has its own policy and copy of the game.

    Args:
        name: of the policy, as `steerclear.policies.make` takes it.
        every: game steps between calls. The policy sees this as the length of a step, and its command is held as a
            course: cheaper, but it plays more coarsely.
    """

    def __init__(self, name: str, every: int = 1) -> None:
        policies.check(name)
        self.name, self.every = name, every
        self._teams: dict[int, Any] = {}

    def reset(self, core: Any, team: int, seed: int) -> None:
        """Begin all games."""
        self._team = team
        self._own = np.flatnonzero(core.team == team)
        self._seeds = {game: seed + game for game in range(core.n_games)}
        self._twins: dict[int, Any] = {}
        self._out = np.zeros((core.n_games, self._own.size, 2))
        self._mine = np.ones(core.n_games, np.bool_)
        self._left = np.zeros(core.n_games, np.int64)
        self._course_deg = np.zeros((core.n_games, self._own.size))

    def plays(self, games: BoolArray) -> None:
        """Play only these games (B,) from now on."""
        self._mine = games

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Restart the chosen games (B,)."""
        for game in np.flatnonzero(chosen):
            self._seeds[int(game)] = seed + int(game)
            self._twins.pop(int(game), None)
        self._left[chosen] = 0

    def act(self, core: Any, team: int) -> Array:
        """Return commands (B, n_team, 2); the next call reuses the array."""
        heading_deg = core.state[:, self._own, L.HEADING]
        self._out[..., 1] = (self._course_deg - heading_deg + 180.0) % 360.0 - 180.0
        for game in np.flatnonzero(self._mine & (self._left == 0)):
            self._out[game] = self._ask(core, int(game))
            self._course_deg[game] = heading_deg[game] + self._out[game, :, 1]
            self._left[game] = self.every
        self._left[self._mine] -= 1
        return self._out

    def _ask(self, core: Any, game: int) -> Array:
        fresh = game not in self._twins
        if fresh:
            rules = core.config.replace(decision_steps=core.config.decision_steps * self.every)
            self._twins[game] = MctfEnv(rules, action_kind="continuous")
            self._twins[game].reset(seed=0)
        env = self._twins[game]
        env.core.restore(core.view(game))
        env.core.observe()
        ids = [core.config.agent_ids[i] for i in self._own]
        if fresh:
            self._teams.setdefault(game, make_team(self.name)).reset(env, ids, self._seeds[game])
        seen = {agent: env.core.observations[0, i].copy() for i, agent in enumerate(core.config.agent_ids)}
        actions = self._teams[game].act(seen, env.infos())
        return env.decode(actions)[self._own]
