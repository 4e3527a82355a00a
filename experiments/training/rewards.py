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


class Sparse:
    """Captures +-1 and grabs +-0.5 of both teams, shared by the team."""

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Nothing is remembered."""

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        events = batch.core.events
        net = events[:, batch.team] - events[:, 1 - batch.team]
        team = 1.0 * net[:, 0] + 0.5 * net[:, 1]
        return np.repeat(team[:, None], len(batch.boats), axis=1)


class Tags(Sparse):
    """Tags made +1, tags suffered -1, shared by the team."""

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        events = batch.core.events
        net = (events[:, batch.team, 2] - events[:, 1 - batch.team, 2]).astype(float)
        return np.repeat(net[:, None], len(batch.boats), axis=1)


class Tagging(Sparse):
    """+1 to a boat that has just tagged an opponent: credit for defending, to who did it."""

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        made: Array = (batch.core.made_tag[:, batch.boats] >= 0).astype(float)
        return made


class Collision(Sparse):
    """-1 for each new collision of the boat itself; the paper's Table 1 weighs it 0.025, its Table 3 fits 0.25."""

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        return -batch.core.new_collisions[:, batch.boats].astype(float)


class Intervention(Sparse):
    """-1 for each game step in which the shield changed the boat's command."""

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        return -changed.astype(float)


class Tagged:
    """-1 to a boat that has just been tagged, or left the field."""

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Remember who is tagged."""
        now = batch.core.is_tagged[:, batch.boats]
        if not hasattr(self, "before") or self.before.shape != now.shape:
            self.before = now.copy()
        self.before[games] = now[games]

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        now = batch.core.is_tagged[:, batch.boats]
        fresh = now & ~self.before
        self.before[:] = now
        return -fresh.astype(float)


class Captures(Sparse):
    """Captures +-1 of both teams, shared by the team: what the game is won by, without a prize for grabs alone."""

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        events = batch.core.events
        net = (events[:, batch.team, 0] - events[:, 1 - batch.team, 0]).astype(float)
        return np.repeat(net[:, None], len(batch.boats), axis=1)


class Own:
    """+1 to the boat that grabs, +2 to the one that brings the flag home, -1 to the one that loses it.

    Credit for who did it. A lost flag costs the grab's prize: else boats that grab in turn and never come home earn
    more than those that do.
    """

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Remember who carries."""
        now = batch.core.has_flag[:, batch.boats]
        if not hasattr(self, "before") or self.before.shape != now.shape:
            self.before = now.copy()
        self.before[games] = now[games]

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        core = batch.core
        now = core.has_flag[:, batch.boats]
        grabbed = now & ~self.before
        given = self.before & ~now
        home = given & (core.events[:, batch.team, 0] > 0)[:, None]
        self.before[:] = now
        return grabbed + 2.0 * home - (given & ~home)


class Progress:
    """Metres gained per field width: towards the other flag for boats without one, towards the own side with it.

    The way to the flag counts while it is home and the boat free; a change of what is sought earns nothing by itself.
    What a tag ends is kept: it leads boats to the flag who know nothing yet, at the price that running into tags again
    and again earns a little. See `Advance`.
    """

    share_back = 0.0

    def begin(self, batch: Any, games: BoolArray) -> None:
        """Remember ways."""
        way, goal = self._ways(batch)
        if not hasattr(self, "way") or self.way.shape != way.shape:
            self.way, self.goal, self.gained = way.copy(), goal.copy(), np.zeros(way.shape)
        self.way[games], self.goal[games], self.gained[games] = way[games], goal[games], 0.0

    def reward(self, batch: Any, changed: BoolArray) -> Array:
        """(B, n) of the last game step."""
        way, goal = self._ways(batch)
        tagged = batch.core.is_tagged[:, batch.boats]
        same = (goal == self.goal) & (goal > 0)
        earned = np.where(tagged, -self.share_back * self.gained, np.where(same, self.way - way, 0.0))
        self.gained += earned
        self.gained[tagged | ((self.goal == 2) & (goal != 2))] = 0.0
        self.way[:], self.goal[:] = way, goal
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
        theirs = super().reward(_other_team(batch), changed).sum(axis=1, keepdims=True)
        return -np.repeat(theirs, len(batch.boats), axis=1)


def _other_team(batch: Any) -> Any:
    """The games as the other team's."""
    return SimpleNamespace(core=batch.core, boats=batch.others, team=1 - batch.team)


TERMS: dict[str, Callable[[], Any]] = {
    "sparse": Sparse,
    "captures": Captures,
    "progress": Progress,
    "advance": Advance,
    "denied": Denied,
    "own": Own,
    "tags": Tags,
    "tagging": Tagging,
    "tagged": Tagged,
    "collision": Collision,
    "intervention": Intervention,
}
"""By the name that a config weighs them with."""


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
