"""Checks that a shield fits its game and serves one team only. A shield remembers the boats it decides for."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from numbers import Integral
from typing import Any

import numpy as np

from ..commands import ROUNDING_MPS, Commands
from ..config import ShieldConfig
from ..decision import Decisions, Reason
from ..exceptions import ConfigError
from ..fleet import Fleet
from ..jit import Array
from ..platforms import get_platform
from ..shield import Shield
from ..surroundings import Surroundings
from . import mctf, pyquaticus  # noqa: F401 (they register their readers)
from .game_facts import GameFacts, facts_of_games, fitting
from .readers import GameReader, reader_of

SIDES = ("blue", "red")

_INNER = ("env", "aec_env", "par_env")
"""Attributes in which PettingZoo's wrappers and conversions hold the environment they wrap."""


def settings_of(game: Any) -> dict[str, float]:
    """Return the settings of a shield for a game: its step and distances, see `Shield.for_game`.

    Raises:
        ConfigError: the game cannot be read, or has settings that no shield can be built for.
    """
    if hasattr(game, "core") or not hasattr(game, "n_games"):
        return facts_of(reader_of(game)).settings()
    return facts_of_games(game).settings()


def facts_of(reader: GameReader) -> GameFacts:
    """Return the facts of a reader's game, checked.

    Raises:
        ConfigError: they are no `GameFacts`, or not of the boats of ``agent_ids``.
    """
    facts = _facts_now(reader)
    faults = facts.faults(len(reader.agent_ids))
    if faults:
        raise ConfigError(f"facts() of the reader {type(reader).__name__}: {faults}")
    return facts


def _facts_now(reader: GameReader) -> GameFacts:
    facts: Any = reader.facts()
    if not isinstance(facts, GameFacts):
        raise ConfigError(
            f"facts() of the reader {type(reader).__name__} gave a {type(facts).__name__}; return a GameFacts("
            "dt_s=..., radius_m=..., team=..., obstacles=...)"
        )
    return facts


def check_boats(env: Any, boats: Sequence[str], reader: GameReader) -> None:
    """Refuse boats of a reader that are no agents of its game, where the game names its agents.

    Raises:
        ConfigError: see above.
    """
    agents = [str(agent) for agent in getattr(env, "possible_agents", ())]
    unknown = [boat for boat in boats if boat not in agents]
    if agents and unknown:
        raise ConfigError(
            f"agent_ids of the reader {type(reader).__name__} holds {', '.join(unknown)}, which the game has not; it "
            f"has {', '.join(agents)}"
        )


def team_number(team: str | int) -> int:
    """Return 0 for "blue" and 1 for "red"."""
    if isinstance(team, str) and team in SIDES:
        return SIDES.index(team)
    if isinstance(team, Integral) and not isinstance(team, bool) and team in (0, 1):
        return int(team)
    raise ConfigError(f"unknown team {team!r}; choose 'blue' or 'red'")


def one_game_shield(shield: Any) -> Any:
    """Return the shield if it decides for a single game; refuse classes, other objects and shields of a batch."""
    if isinstance(shield, type) or not callable(getattr(shield, "decide", None)) or hasattr(shield, "filter_for"):
        found = shield.__name__ if isinstance(shield, type) else type(shield).__name__
        raise ConfigError(f"{found} is no shield of one game; give steerclear.shield.Shield.for_game(game)")
    return shield


def words_of(shield: Any) -> str:
    """Describe a shield for a repr: its main settings, or its type where it has none."""
    config = getattr(shield, "config", None)
    if not isinstance(config, ShieldConfig):
        return type(shield).__name__
    return f"Shield(separation_m={config.separation_m:g}, profile={config.profile!r}, dt_s={config.dt_s:g})"


class Serving:
    """Checks that a shield serves its holder only. Deciders of the user's own are never refused."""

    def __init__(self, shield: Any) -> None:
        self.shield = shield

    def begin(self) -> None:
        """Reset the shield and let it serve the holder."""
        self.shield.reset()
        if isinstance(self.shield, Shield):
            self.shield.serves = self

    def check(self) -> None:
        """Refuse a shield that serves someone else. A shield that serves nobody now serves the holder.

        Raises:
            ConfigError: the shield has begun to serve another team or game.
        """
        if not isinstance(self.shield, Shield):
            return
        if self.shield.serves is None:  # someone reset it
            self.shield.serves = self
        if self.shield.serves is not self:
            raise ConfigError(
                "this shield has begun to serve another team or game since this one's reset; give each a Shield of its "
                "own, or reset() it between them"
            )


class ShieldedGame:
    """A shield at work for one team of one game.

    Args:
        shield: the shield, or a decider of the user's own, which is not adapted to the game.
        reader: reads the game.
        team: 0 or 1.
        shield_autopilot: also decide for game-controlled boats (our env only).
        keep_out: keep clear of the own flag's circle, in which the game stops boats.
        held: decide once for all substeps of one action; otherwise decide before each substep.

    Attributes:
        shield: the shield, or a copy of it with the game's distances where the user chose none.

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
        """Begin a game with a reset shield.

        Raises:
            ConfigError: the game's settings have changed and the shield does not fit them.
        """
        self._fit()
        self._serving.begin()

    def _fit(self) -> None:
        """Fit the shield to the game's settings and copy them, so that later changes can be noticed."""
        facts = facts_of(self.reader)
        config = getattr(self.shield, "config", None)
        if isinstance(config, ShieldConfig):
            better = fitting(config, facts, self.team, self._held)
            if better is not config and isinstance(self.shield, Shield):
                around, self.shield = self.shield.surroundings, copy.copy(self.shield)
                Shield.__init__(self.shield, better, around)
        self._facts = facts._replace(radius_m=np.array(facts.radius_m), team=np.array(facts.team))
        self._serving = Serving(self.shield)

    def check(self) -> None:
        """Refuse a game whose settings have changed since the reset, and a shield that serves someone else.

        Raises:
            ConfigError: the settings have changed, no shield can be built for them, or the shield serves someone else.
        """
        now = _facts_now(self.reader)
        for name in GameFacts._fields:
            then, found = getattr(self._facts, name), getattr(now, name)
            if not np.array_equal(then, found):
                then, found = np.asarray(then).tolist(), np.asarray(found).tolist()
                raise ConfigError(f"{name} of the game was {then} at its reset and is {found} now; reset() it")
        self._serving.check()

    def seen(self) -> tuple[Fleet, Surroundings]:
        """Return the boats as they are, and their surroundings."""
        fleet, n = self.reader.fleet(self.team, self.shield_autopilot), len(self.reader.agent_ids)
        if not isinstance(fleet, Fleet) or len(fleet) != n:
            found = f"{len(fleet)} boats" if isinstance(fleet, Fleet) else f"a {type(fleet).__name__}"
            who = type(self.reader).__name__
            raise ConfigError(f"fleet() of the reader {who} gave {found}; return a Fleet of the {n} boats of agent_ids")
        return fleet, self.reader.surroundings(self.team, self.keep_out)

    def decide(self, commands: Array) -> Decisions:
        """Decide on commands (n, 2) of all boats: speed m/s, relative heading deg."""
        fleet, around = self.seen()
        decisions: Decisions = self.shield.decide(fleet, Commands.game_deg(commands), around)
        if isinstance(self.shield, Shield):
            _say_limited(decisions)
        return decisions


def _say_limited(decisions: Decisions) -> None:
    """Tell speeds beyond a platform's range as `Shield.decide` does elsewhere; here the game cuts them itself."""
    speed_mps, fleet = decisions.nominal.values[:, 0], decisions.fleet
    highest_mps = np.array([get_platform(kind).max_speed_mps for kind in fleet.platforms])
    beyond = (speed_mps > highest_mps + ROUNDING_MPS) | (speed_mps < -ROUNDING_MPS)
    decisions.reason[beyond & (decisions.reason == Reason.PASSED)] = Reason.LIMITED


def layers_of(env: Any) -> Iterator[Any]:
    """Yield the environment and everything it wraps, outermost first."""
    while env is not None:
        yield env
        inner = vars(env) if hasattr(env, "__dict__") else {}
        env = next((inner[name] for name in _INNER if inner.get(name) is not None), None)
