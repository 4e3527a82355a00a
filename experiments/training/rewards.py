"""Reward terms; a learner's reward in each game step is their weighted sum."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import layout as L

from ..play.spec import near

Earned = Callable[[Any, BoolArray], Array]


class Term:
    """A stateless reward term.

    Args:
        earned: returns the last game step's reward, (B, n), or (B, 1) if the team shares it, from the batch and (B, n)
            whether the shield changed each command.
    """

    def __init__(self, earned: Earned) -> None:
        self.reward = earned

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Start games (B,) anew."""


def _net(batch: Any, event: int) -> Array:
    """Return (B, 1): events of the own team minus the other's; events are captures 0, grabs 1, tags 2."""
    events = batch.core.events
    net: Array = (events[:, batch.team, event] - events[:, 1 - batch.team, event]).astype(float)[:, None]
    return net


def _remembered(before: Array | None, now: Array, games: BoolArray) -> Array:
    """Return the stored values, replaced by the current ones in games (B,) that begin or if nothing was stored."""
    kept = now.copy() if before is None or before.shape != now.shape else before
    kept[games] = now[games]
    return kept


class Changed:
    """A reward for changes of a boat quantity of the core in the last game step.

    Args:
        fact: name of its array.
        earned: returns (B, n) from the batch and the array before and after the step.
    """

    before: Array | None = None

    def __init__(self, fact: str, earned: Callable[[Any, BoolArray, BoolArray], Array]) -> None:
        self._fact, self._earned = fact, earned

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Store the array for games (B,) that begin."""
        self.before = _remembered(self.before, getattr(batch.core, self._fact)[:, batch.boats], games)

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """Return the reward (B, n) of the last game step."""
        before, self.before = self.before, getattr(batch.core, self._fact)[:, batch.boats]
        return self._earned(batch, before, self.before)


def _own(batch: Any, before: BoolArray, now: BoolArray) -> Array:
    """Reward +1 for the boat that grabs the flag, +2 for the one that brings it home, -1 for the one that loses it.

    A lost flag costs as much as the grab earned. Otherwise boats that grab in turn and never come home earn more than
    boats that capture.
    """
    given = before & ~now
    home = given & (batch.core.events[:, batch.team, 0] > 0)[:, None]
    earned: Array = (now & ~before) + 2.0 * home - (given & ~home)
    return earned


class Progress:
    """Progress in metres per field width: towards the other flag, or towards the own side when carrying it.

    The way to the flag counts while the flag is home and the boat untagged; a change of goal earns nothing by itself.
    A tagged boat keeps its progress. This leads untrained boats to the flag, but running into tags repeatedly earns a
    little. See `Advance`.
    """

    share_back = 0.0
    way: Array | None = None
    goal: Array | None = None
    gained: Array | None = None

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Store distances and goals for games (B,) that begin."""
        way, goal = self._ways(batch)
        self.way, self.goal = _remembered(self.way, way, games), _remembered(self.goal, goal, games)
        self.gained = _remembered(self.gained, np.zeros(way.shape), games)

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """Return the reward (B, n) of the last game step."""
        way, goal = self._ways(batch)
        tagged = batch.core.is_tagged[:, batch.boats]
        same = (goal == self.goal) & (goal > 0)
        earned = np.where(tagged, -self.share_back * self.gained, np.where(same, self.way - way, 0.0))
        kept = ~tagged & ((self.goal != 2) | (goal == 2))
        self.gained = np.where(kept, self.gained + earned, 0.0)
        self.way, self.goal = way, goal
        return earned / float(batch.core.config.env_bounds_m[0])

    @staticmethod
    def _ways(batch: Any) -> tuple[Array, Array]:
        """Return (B, n) metres to go, and the goal: 0 none, 1 the flag, 2 the own side."""
        core, boats, foe = batch.core, batch.boats, 1 - batch.team
        state = core.state[:, boats]
        x, y = state[..., L.X], state[..., L.Y]
        flag = core.flag_home[foe]
        middle = 0.5 * (core.flag_home[0, 0] + core.flag_home[1, 0])
        carries, tagged = core.has_flag[:, boats], core.is_tagged[:, boats]
        taken = core.flag_taken[:, foe][:, None]
        goal = np.where(carries, 2, np.where(tagged | taken, 0, 1)).astype(float)
        home = np.abs(x - middle)
        return np.where(carries, home, np.hypot(x - flag[0], y - flag[1])), goal


class Advance(Progress):
    """`Progress`, but a tagged boat gives back all it earned since it last set out; a capture keeps it.

    Without captures the sum is zero, so the optimal policy does not change (potential-based: Ng, Harada and Russell
    1999). Untrained boats learn from it to avoid tags first.
    """

    share_back = 1.0


class Denied(Advance):
    """Negative sum of the opponents' `Advance`, shared by the team.

    A tag immediately earns what the tagged boat had gained, most for a flag carrier near home. So defending is
    rewarded long before a capture is lost.
    """

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Store the opponents' distances and goals."""
        super().begin(_other_team(batch), games)

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """Return the reward (B, 1) of the last game step."""
        return -super().reward(_other_team(batch), changed).sum(axis=1, keepdims=True)


def _other_team(batch: Any) -> Any:
    """Return the games as the other team sees them."""
    return SimpleNamespace(core=batch.core, boats=batch.others, team=1 - batch.team)


TERMS: dict[str, Callable[[], Any]] = {
    "sparse": lambda: Term(lambda batch, changed: _net(batch, 0) + 0.5 * _net(batch, 1)),
    "captures": lambda: Term(lambda batch, changed: _net(batch, 0)),
    "progress": Progress,
    "advance": Advance,
    "denied": Denied,
    "own": lambda: Changed("has_flag", _own),
    "tags": lambda: Term(lambda batch, changed: _net(batch, 2)),
    "tagging": lambda: Term(lambda batch, changed: (batch.core.made_tag[:, batch.boats] >= 0).astype(float)),
    "tagged": lambda: Changed("is_tagged", lambda batch, before, now: -(now & ~before).astype(float)),
    "collision": lambda: Term(lambda batch, changed: -batch.core.new_collisions[:, batch.boats].astype(float)),
    "intervention": lambda: Term(lambda batch, changed: -changed.astype(float)),
}
"""Terms by their name in a config; docs/train.md describes each.

The team shares ``sparse``, ``captures`` and ``tags``; ``tagging`` goes to the boat that tagged. For ``collision`` the
paper's Table 1 gives the weight 0.025; its Table 3 fits 0.25.
"""


class WeightedSum:
    """Reward of a config.

    Args:
        weights: by name of `TERMS`.

    Raises:
        ConfigError: unknown name.
    """

    def __init__(self, weights: Mapping[str, float]) -> None:
        for name in weights:
            if name not in TERMS:
                raise ConfigError(f"unknown reward term {name!r}; {near(name, TERMS)}")
        self.weights = dict(weights)
        self.terms = {name: TERMS[name]() for name in weights}

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Start games (B,) anew."""
        for term in self.terms.values():
            term.begin(batch, games)

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """Return the reward (B, n) of the last game step."""
        total = np.zeros((batch.core.n_games, len(batch.boats)))
        for name, term in self.terms.items():
            total += self.weights[name] * term.reward(batch, changed)
        return total
