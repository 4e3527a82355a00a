"""Reading a game: how the shield gets absolute positions and commands out of an environment object.

Positions come from the environment itself, never from observations: those are relative, rounded and may be normalised.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from numbers import Integral
from typing import Any, Protocol

from ..exceptions import ConfigError
from ..fleet import Fleet
from ..jit import Array
from ..surroundings import Surroundings
from .game_facts import GameFacts

KEEP_OUT_MARGIN_M = 0.1
"""Distance kept beyond a flag's keep-out circle, m: the game throws boats back that touch it."""

SIDES = {"blue": 0, "red": 1}


class GameReader(Protocol):
    """What the wrappers need to know of an environment."""

    agent_ids: tuple[str, ...]
    takes_pairs_only: bool
    """Whether, once a boat has had a (speed, relative heading) pair, all its actions must be pairs."""

    def facts(self) -> GameFacts:
        """Step and sizes.

        Raises:
            ConfigError: the game has settings that no shield can be built for.
        """

    def filtering(self, safe: Callable[[Array], Array]) -> AbstractContextManager[None]:
        """While inside, commands (n, 2) pass ``safe`` before the boats move; afterwards the game is as it was."""

    def check_answers(self, agent_ids: Sequence[str]) -> None:
        """Check that the game plays what a shield around a policy answers, one command a step.

        Raises:
            ConfigError: it does not.
        """

    def moment(self) -> float:
        """Time of the game, s: it is another after every step."""

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """All boats now; controlled are those of ``team`` that the shield can decide for."""

    def commands(self, actions: Mapping[str, Any]) -> Array:
        """(n, 2) speed m/s and relative heading deg of the actions, as the game plays them; missing boats stop.

        Raises:
            GameError: an action is none, or of no boat of the game.
        """

    def playable(self, actions: Mapping[str, Any]) -> dict[str, Any]:
        """The actions in a form the environment itself takes; those it takes already are the very same objects."""

    def surroundings(self, team: int, keep_out: bool) -> Surroundings:
        """Field edge, obstacles and (with ``keep_out``) the own flag's circle."""


def team_number(team: str | int) -> int:
    """0 for "blue", 1 for "red".

    Raises:
        ConfigError: neither.
    """
    if isinstance(team, str) and team in SIDES:
        return SIDES[team]
    if isinstance(team, Integral) and not isinstance(team, bool) and team in (0, 1):
        return int(team)
    raise ConfigError(f"unknown team {team!r}; choose 'blue' or 'red'")


def one_game_shield(shield: Any) -> Any:
    """The shield itself, if it is one for a single game.

    Raises:
        ConfigError: it decides for no fleet, such as the shield of a batch of games.
    """
    if isinstance(shield, type) or not callable(getattr(shield, "decide", None)) or hasattr(shield, "filter_for"):
        found = shield.__name__ if isinstance(shield, type) else type(shield).__name__
        raise ConfigError(f"{found} is no shield of one game; give steerclear.shield.Shield.for_game(game)")
    return shield


def parallel_game(env: Any) -> Any:
    """The environment itself, if all boats of it act at once.

    Raises:
        ConfigError: they act in turn (AEC), or it is a class.
    """
    if isinstance(env, type):
        raise ConfigError(f"{env.__name__} is a class; give an environment: {env.__name__}(...)")
    if callable(getattr(type(env), "last", None)) and callable(getattr(type(env), "agent_iter", None)):
        raise ConfigError(
            f"{type(env).__name__} is an AEC env, in which boats act in turn, and the shield decides for all at once; "
            "wrap the parallel env: parallel_to_aec(ShieldedParallelEnv(mctf_v0.parallel_env(...), Shield()))"
        )
    return env


def obstacles_of(obstacles: Mapping[str, Any] | None) -> tuple[list[Any], list[Any]]:
    """Circles (x, y, radius) and polygons from {"circle": [(radius, (x, y))], "polygon": [((x, y), ...)]}."""
    found = obstacles or {}
    circles = [(float(c[0]), float(c[1]), float(r)) for r, c in found.get("circle") or ()]
    polygons = [tuple((float(x), float(y)) for x, y in points) for points in found.get("polygon") or ()]
    return circles, polygons
