"""`Plan`: the behaviours of a scripted team, for any team size and game."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array

from .layout import Behaviour

MEDIUM_REACH_M = 60.0
ROLES = ("attack", "defend")
COMPOSITIONS = ("defend", "attack", "mixed")
"""The hidden opponent's teams, in the order of consecutive seeds."""


@dataclass(frozen=True)
class Plan:
    """A scripted team's settings.

    Attributes:
        pair: behaviour of an attacker, and of a defender.
        roles: "attack" and "defend", one for all boats or one each; empty: a third of the team (rounded) defends, last
            boats first; None: as the hidden opponent, all defend, all attack or mixed, in turn with the seed.
        boats: behaviours, one for all or one each; if given, ``pair`` and ``roles`` have no effect.
        points: waypoints in m, (k, 2) for all boats or (n_team, k, 2) per boat; None for random ones.
        speed_fraction: share of top speed of rammers and waypoint boats.
        target_team_mates: rammers also target boats of their own team.
        reach_m: opponents within this distance repel a medium attacker, m.
    """

    pair: tuple[Behaviour, Behaviour] = (Behaviour.HOLD, Behaviour.HOLD)
    roles: tuple[str, ...] | None = ()
    boats: tuple[Behaviour, ...] = ()
    points: Array | None = None
    speed_fraction: float = 1.0
    target_team_mates: bool = False
    reach_m: float = MEDIUM_REACH_M

    def cast(self, team_size: int, seed: int) -> list[Behaviour]:
        """Return the behaviour of each boat of a team."""
        if self.boats:
            return _one_each("boats", self.boats, team_size)
        roles = roles_of(composition_of(seed)) if self.roles is None else self.roles
        defenders = round(team_size / 3)
        chosen = roles or ("attack",) * (team_size - defenders) + ("defend",) * defenders
        return [self.pair[ROLES.index(role)] for role in _one_each("roles", chosen, team_size)]


def _one_each(what: str, given: Sequence[Any], team_size: int) -> list[Any]:
    if len(given) not in (1, team_size):
        raise PolicyError(f"{what} names {len(given)} boats for a team of {team_size}; give one for all or one each")
    return list(given) * (team_size if len(given) == 1 else 1)


def words_of(what: str, given: str | Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """Return the words of a list, or of a text with commas."""
    parts = given.split(",") if isinstance(given, str) else list(given)
    words = tuple(str(part).strip().lower() for part in parts)
    for word in words or ("",):
        if word not in known:
            found = f"has {word!r}" if words else "is empty"
            raise PolicyError(f"{what} {found}; choose from {', '.join(known)}")
    return words


def composition_of(game: int) -> str:
    """Return the hidden opponent's team in a game of a series."""
    if isinstance(game, bool) or not isinstance(game, (int, np.integer)) or game < 0:
        raise PolicyError(f"game is {game!r}; give the number of the game, from 0")
    return COMPOSITIONS[int(game) % len(COMPOSITIONS)]


def roles_of(composition: str | int) -> tuple[str, ...]:
    """Return the roles of one of `COMPOSITIONS`, given by name or number."""
    if isinstance(composition, int) and not isinstance(composition, bool) and 0 <= composition < len(COMPOSITIONS):
        composition = COMPOSITIONS[composition]
    if composition not in COMPOSITIONS:
        raise PolicyError(f"composition is {composition!r}; give one of {', '.join(COMPOSITIONS)}, 0..2, or nothing")
    return () if composition == "mixed" else (str(composition),)


def checked_points(points: Any) -> Array | None:
    """Return waypoints as an array (k, 2) or (n_team, k, 2), m."""
    if points is None:
        return None
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise PolicyError(f"points are no (x, y) in m, or not equally many for all boats: {error}") from error
    if array.ndim not in (2, 3) or array.shape[-1] != 2 or array.size == 0 or not np.isfinite(array).all():
        raise PolicyError(f"points have shape {array.shape}; give finite (x, y) in m: (k, 2) or (boats, k, 2)")
    return array


def checked_number(name: str, value: Any, most: float, what: str) -> float:
    """Check that a value is a finite number above 0 and at most ``most``."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value <= most or value == np.inf:
        raise PolicyError(f"{name} is {value!r}; give {what}")
    return float(value)
