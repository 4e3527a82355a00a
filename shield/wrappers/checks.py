"""A shield at work in one game: whether it fits, and serves nobody else, since it remembers the boats it decides for.

What a wrapper relies on is checked here, or taken from the game.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from numbers import Integral
from typing import Any

import numpy as np

from ..commands import Commands
from ..config import ShieldConfig
from ..decision import Decisions
from ..exceptions import ConfigError
from ..fleet import Fleet
from ..jit import Array
from ..shield import Shield
from ..surroundings import Surroundings
from . import mctf, pyquaticus  # noqa: F401 (they register their readers)
from .game_facts import GameFacts, facts_of_games, fitting
from .readers import GameReader, reader_of

SIDES = ("blue", "red")

_INNER = ("env", "aec_env", "par_env")
"""Where PettingZoo's wrappers and conversions keep what they wrap."""


def settings_of(game: Any) -> dict[str, float]:
    """Settings of a shield for a game: its step and distances, see `Shield.for_game`.

    Raises:
        ConfigError: no game that can be read, or one with settings that no shield can be built for.
    """
    if hasattr(game, "core") or not hasattr(game, "n_games"):
        return reader_of(game).facts().settings()
    return facts_of_games(game).settings()


def team_number(team: str | int) -> int:
    """0 for "blue", 1 for "red"."""
    if isinstance(team, str) and team in SIDES:
        return SIDES.index(team)
    if isinstance(team, Integral) and not isinstance(team, bool) and team in (0, 1):
        return int(team)
    raise ConfigError(f"unknown team {team!r}; choose 'blue' or 'red'")


def one_game_shield(shield: Any) -> Any:
    """The shield itself, if it is one for a single game, and not for a batch of them."""
    if isinstance(shield, type) or not callable(getattr(shield, "decide", None)) or hasattr(shield, "filter_for"):
        found = shield.__name__ if isinstance(shield, type) else type(shield).__name__
        raise ConfigError(f"{found} is no shield of one game; give steerclear.shield.Shield.for_game(game)")
    return shield


def words_of(shield: Any) -> str:
    """What a shield keeps, for whoever prints what it is wrapped round; its kind where it has no settings."""
    config = getattr(shield, "config", None)
    if not isinstance(config, ShieldConfig):
        return type(shield).__name__
    return f"Shield(separation_m={config.separation_m:g}, profile={config.profile!r}, dt_s={config.dt_s:g})"


class Serving:
    """Whether a shield serves whoever holds this, and not another team or game; deciders of users' own always do."""

    def __init__(self, shield: Any) -> None:
        self.shield = shield

    def begin(self) -> None:
        """Let the shield forget all and serve the holder."""
        self.shield.reset()
        if isinstance(self.shield, Shield):
            self.shield.serves = self

    def check(self) -> None:
        """Refuse a shield that has begun to serve others since; one that serves nobody serves the holder now.

        Raises:
            ConfigError: it has.
        """
        if not isinstance(self.shield, Shield):
            return
        if self.shield.serves is None:  # somebody reset it
            self.shield.serves = self
        if self.shield.serves is not self:
            raise ConfigError(
                "this shield has begun to serve another team or game since this one's reset; give each a Shield of its "
                "own, or reset() it between them"
            )


class ShieldedGame:
    """A shield at work for one team of one game.

    Args:
        shield: the shield, or a decider of the user's own, which is taken as it is.
        reader: reads the game.
        team: 0 or 1.
        shield_autopilot: also decide for boats the game drives (our env only).
        keep_out: keep clear of the own flag's circle, in which the game stops boats.
        held: decide once for all the moves that the game makes of a policy's answer, else before each.

    Attributes:
        shield: the shield, or one like it with the game's distances where nobody chose them.

    Raises:
        ConfigError: the shield is for another step, or the game has settings that no shield can be built for.
    """

    def __init__(
        self, shield: Any, reader: GameReader, team: int, shield_autopilot: bool, keep_out: bool, held: bool = False
    ) -> None:
        self.shield, self.reader, self.team = shield, reader, team
        self.shield_autopilot, self.keep_out, self._held = shield_autopilot, keep_out, held
        self._fit()

    def begin(self) -> None:
        """Begin a game with a shield that remembers nothing.

        Raises:
            ConfigError: the game was set since to what the shield is not for.
        """
        self._fit()
        self._serving.begin()

    def _fit(self) -> None:
        """Make the shield fit the game as it is, and note what that is; later changes of its arrays change no fact."""
        facts = self.reader.facts()
        config = getattr(self.shield, "config", None)
        if isinstance(config, ShieldConfig):
            better = fitting(config, facts, self.team, self._held)
            if better is not config and isinstance(self.shield, Shield):
                around, self.shield = self.shield.surroundings, copy.copy(self.shield)
                Shield.__init__(self.shield, better, around)
        self._facts = facts._replace(radius_m=np.array(facts.radius_m), team=np.array(facts.team))
        self._serving = Serving(self.shield)

    def check(self) -> None:
        """Refuse a game that was set to something else in its middle, and a shield that serves others.

        Raises:
            ConfigError: it was, or has settings by now that no shield can be built for, or the shield does.
        """
        now = self.reader.facts()
        for name in GameFacts._fields:
            then, found = getattr(self._facts, name), getattr(now, name)
            if not np.array_equal(then, found):
                then, found = np.asarray(then).tolist(), np.asarray(found).tolist()
                raise ConfigError(f"{name} of the game was {then} at its reset and is {found} now; reset() it")
        self._serving.check()

    def seen(self) -> tuple[Fleet, Surroundings]:
        """The boats now, and what is around them."""
        fleet = self.reader.fleet(self.team, self.shield_autopilot)
        return fleet, self.reader.surroundings(self.team, self.keep_out)

    def decide(self, commands: Array) -> Decisions:
        """Decide on commands (n, 2) of all boats: speed m/s, relative heading deg."""
        fleet, around = self.seen()
        decisions: Decisions = self.shield.decide(fleet, Commands.game_deg(commands), around)
        return decisions


def layers_of(env: Any) -> Iterator[Any]:
    """The environment and all it wraps, outermost first."""
    while env is not None:
        yield env
        inner = vars(env) if hasattr(env, "__dict__") else {}
        env = next((inner[name] for name in _INNER if inner.get(name) is not None), None)
