"""Reward terms as small objects; a learner's reward is their weighted sum, each game step."""

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
    """A reward term that remembers nothing.

    Args:
        earned: of the last game step, (B, n), or (B, 1) where the team shares it: takes the batch, and (B, n) whose
            commands the shield changed.
    """

    def __init__(self, earned: Earned) -> None:
        self.reward = earned

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Games (B,) begin anew."""


def _net(batch: Any, event: int) -> Array:
    """(B, 1) an event of the own team less the other's: captures 0, grabs 1, tags 2."""
    events = batch.core.events
    net: Array = (events[:, batch.team, event] - events[:, 1 - batch.team, event]).astype(float)[:, None]
    return net


def _remembered(before: Array | None, now: Array, games: BoolArray) -> Array:
    """What is remembered, as it is now in games (B,) that begin, and everywhere where nothing was."""
    kept = now.copy() if before is None or before.shape != now.shape else before
    kept[games] = now[games]
    return kept


class Changed:
    """A term of what the last game step changed in a fact of the core about boats.

    Args:
        fact: name of the array.
        earned: (B, n) from the batch and that fact, before and now.
    """

    before: Array | None = None

    def __init__(self, fact: str, earned: Callable[[Any, BoolArray, BoolArray], Array]) -> None:
        self._fact, self._earned = fact, earned

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Remember it."""
        self.before = _remembered(self.before, getattr(batch.core, self._fact)[:, batch.boats], games)

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        before, self.before = self.before, getattr(batch.core, self._fact)[:, batch.boats]
        return self._earned(batch, before, self.before)


def _own(batch: Any, before: BoolArray, now: BoolArray) -> Array:
    """+1 to the boat that grabs, +2 to the one that brings the flag home, -1 to the one that loses it.

    Credit for who did it. A lost flag costs the grab's prize: else boats that grab in turn and never come home earn
    more than those that do.
    """
    given = before & ~now
    home = given & (batch.core.events[:, batch.team, 0] > 0)[:, None]
    earned: Array = (now & ~before) + 2.0 * home - (given & ~home)
    return earned


class Progress:
    """Metres gained per field width: towards the other flag for boats without one, towards the own side with it.

    The way to the flag counts while it is home and the boat free; a change of what is sought earns nothing by itself.
    What a tag ends is kept: it leads boats to the flag who know nothing yet, at the price that running into tags again
    and again earns a little. See `Advance`.
    """

    share_back = 0.0
    way: Array | None = None
    goal: Array | None = None
    gained: Array | None = None

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Remember ways."""
        way, goal = self._ways(batch)
        self.way, self.goal = _remembered(self.way, way, games), _remembered(self.goal, goal, games)
        self.gained = _remembered(self.gained, np.zeros(way.shape), games)

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
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
        """(B, n) metres to go, and what is sought: 0 nothing, 1 the flag, 2 the own side."""
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
    """`Progress` of which a boat gives back all since it last set out when it is tagged; a capture keeps it.

    Nothing is earned without captures, so what is best stays best (potential-based: Ng, Harada and Russell 1999); boats
    that know nothing yet learn from it to keep away from tags first.
    """

    share_back = 1.0


class Denied(Advance):
    """The opponents' `Advance`, all of them together, with a minus sign and shared by the team.

    A tag earns at once what the tagged boat had gained, most from one that comes home with the flag: credit for
    defending long before a capture is lost.
    """

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Remember the opponents' ways."""
        super().begin(_other_team(batch), games)

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        return -super().reward(_other_team(batch), changed).sum(axis=1, keepdims=True)


def _other_team(batch: Any) -> Any:
    """The games as the other team's."""
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
"""By the name that a config weighs them with; docs/train.md says what each is.

``sparse``, ``captures`` and ``tags`` are the team's, which its boats share; ``tagging`` pays who made the tag. Of
``collision`` the paper's Table 1 weighs 0.025, its Table 3 fits 0.25.
"""


class WeightedSum:
    """The reward of a config.

    Args:
        weights: by name of `TERMS`.

    Raises:
        ConfigError: an unknown name.
    """

    def __init__(self, weights: Mapping[str, float]) -> None:
        for name in weights:
            if name not in TERMS:
                raise ConfigError(f"unknown reward term {name!r}; {near(name, TERMS)}")
        self.weights = dict(weights)
        self.terms = {name: TERMS[name]() for name in weights}

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Games (B,) begin anew."""
        for term in self.terms.values():
            term.begin(batch, games)

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        total = np.zeros((batch.core.n_games, len(batch.boats)))
        for name, term in self.terms.items():
            total += self.weights[name] * term.reward(batch, changed)
        return total
