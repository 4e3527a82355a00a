"""Reading a game: how the shield gets absolute positions and commands out of an environment object.

Positions come from the environment itself, never from observations: those are relative, rounded and may be normalised.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, Protocol

import numpy as np

from ..exceptions import ConfigError
from ..fleet import Fleet
from ..game_facts import GameFacts
from ..jit import Array
from ..surroundings import Surroundings

KEEP_OUT_MARGIN_M = 0.1
"""Distance kept beyond a flag's keep-out circle, m: the game throws boats back that touch it."""

HEADINGS_DEG = (180.0, 135.0, 90.0, 45.0, 0.0, -45.0, -90.0, -135.0)

DISCRETE = np.array([(share, heading) for share in (1.0, 0.5) for heading in HEADINGS_DEG] + [(0.0, 0.0)])
"""(17, 2) the game's discrete actions: share of top speed and relative heading, deg; the last one stops."""

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

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """All boats now; controlled are those of ``team`` that the shield can decide for."""

    def commands(self, actions: Mapping[str, Any]) -> Array:
        """(n, 2) speed m/s and relative heading deg of the actions; NaN rows for boats without a usable one."""

    def surroundings(self, team: int, keep_out: bool) -> Surroundings:
        """Field edge, obstacles and (with ``keep_out``) the own flag's circle."""


def team_number(team: str | int) -> int:
    """0 for "blue", 1 for "red".

    Raises:
        ConfigError: neither.
    """
    if team in (0, 1):
        return int(team)
    if team not in SIDES:
        raise ConfigError(f"unknown team {team!r}; choose 'blue' or 'red'")
    return SIDES[str(team)]


def one_game_shield(shield: Any) -> Any:
    """The shield itself, if it is one for a single game.

    Raises:
        ConfigError: it decides for no fleet, such as the shield of a batch of games.
    """
    if isinstance(shield, type) or not callable(getattr(shield, "decide", None)) or hasattr(shield, "filter_for"):
        found = shield.__name__ if isinstance(shield, type) else type(shield).__name__
        raise ConfigError(f"{found} is no shield of one game; give steerclear.shield.Shield.for_game(game)")
    return shield


def reader_of(env: Any) -> GameReader:
    """The reader for an environment: ours, or a real Pyquaticus one.

    Raises:
        ConfigError: neither of the two.
    """
    from .mctf import MctfReader
    from .pyquaticus import PyquaticusReader

    base = getattr(env, "unwrapped", env)
    if hasattr(base, "core") and hasattr(base, "command_filter"):
        return MctfReader(base)
    if hasattr(base, "players") and hasattr(base, "flag_homes"):
        return PyquaticusReader(base)
    raise ConfigError(
        f"cannot read a game from {type(base).__name__}; give an MctfEnv, a Pyquaticus env, or use Shield.decide "
        "with a Fleet of your own"
    )


def obstacles_of(obstacles: Mapping[str, Any] | None) -> tuple[list[Any], list[Any]]:
    """Circles (x, y, radius) and polygons from {"circle": [(radius, (x, y))], "polygon": [((x, y), ...)]}."""
    found = obstacles or {}
    circles = [(float(c[0]), float(c[1]), float(r)) for r, c in found.get("circle") or ()]
    polygons = [tuple((float(x), float(y)) for x, y in points) for points in found.get("polygon") or ()]
    return circles, polygons


def no_commands(n: int) -> Array:
    """Commands nobody gave yet: (n, 2) NaN."""
    return np.full((n, 2), np.nan)
