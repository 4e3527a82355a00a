"""`Plan`: who does what in a scripted team, for any team size and game."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array

from .layout import Behaviour

Cast = Callable[[int, int], Sequence[Behaviour]]
"""``cast(team_size, seed) -> behaviours``, one per boat."""

MEDIUM_REACH_M = 60.0
ROLES = ("attack", "defend")
COMPOSITIONS = ("defend", "attack", "mixed")
"""The hidden opponent's teams, in the order in which consecutive seeds meet them."""


@dataclass(frozen=True)
class Plan:
    """A scripted team's settings.

    Attributes:
        cast: chooses every boat's behaviour.
        points: waypoints in m, (k, 2) for all boats or (n_team, k, 2) per boat; None for random ones.
        speed_fraction: share of top speed that rammers and waypoint boats ask for.
        target_team_mates: rammers aim at boats of their own team too.
        reach_m: opponents within this distance push a medium attacker off, m.
    """

    cast: Cast
    points: Array | None = None
    speed_fraction: float = 1.0
    target_team_mates: bool = False
    reach_m: float = MEDIUM_REACH_M


@dataclass(frozen=True)
class Everyone:
    """All boats do the same."""

    behaviour: Behaviour

    def __call__(self, team_size: int, seed: int) -> list[Behaviour]:
        """Behaviours of a team."""
        return [self.behaviour] * team_size


@dataclass(frozen=True)
class InRoles:
    """Boats by role; without roles a third of the team (rounded) defends, last boats first."""

    attack: Behaviour
    defend: Behaviour
    roles: tuple[str, ...] | None

    def __call__(self, team_size: int, seed: int) -> list[Behaviour]:
        """Behaviours of a team.

        Raises:
            PolicyError: the wrong number of roles.
        """
        chosen = default_roles(team_size) if self.roles is None else fit("roles", self.roles, team_size)
        return [self.attack if role == "attack" else self.defend for role in chosen]


@dataclass(frozen=True)
class ByName:
    """Each boat does what it is told by name."""

    names: tuple[str, ...]

    def __call__(self, team_size: int, seed: int) -> list[Behaviour]:
        """Behaviours of a team.

        Raises:
            PolicyError: the wrong number of names.
        """
        return [Behaviour[word.upper()] for word in fit("boats", self.names, team_size)]


@dataclass(frozen=True)
class Hidden:
    """The hidden opponent's team; without a composition they come in turn with the seed."""

    composition: str | None

    def __call__(self, team_size: int, seed: int) -> list[Behaviour]:
        """Behaviours of a team."""
        chosen = composition_of(seed) if self.composition is None else self.composition
        roles = None if chosen == "mixed" else (chosen,)
        return InRoles(Behaviour.MEDIUM_ATTACK, Behaviour.MEDIUM_DEFEND, roles)(team_size, seed)


def everyone(behaviour: Behaviour) -> Cast:
    """All boats do the same."""
    return Everyone(behaviour)


def in_roles(attack: Behaviour, defend: Behaviour, roles: str | Sequence[str] | None) -> Cast:
    """Boats by role.

    Args:
        attack: what an attacker does.
        defend: what a defender does.
        roles: "attack,attack,defend" or a list of such words, one per boat; one word for all boats; None for a third of
            the team (rounded) defending, last boats first.

    Raises:
        PolicyError: an unknown role; the wrong number of roles is reported once the team's size is known.
    """
    return InRoles(attack, defend, None if roles is None else tuple(_words("roles", roles, ROLES)))


def by_name(names: str | Sequence[str]) -> Cast:
    """Boats by behaviour, such as "medium_attack,rammer,hold"; one name for all boats.

    Raises:
        PolicyError: an unknown behaviour.
    """
    known = tuple(behaviour.name.lower() for behaviour in Behaviour)
    return ByName(tuple(_words("boats", names, known)))


def hidden(composition: str | int | None) -> Cast:
    """The hidden opponent: all defend, all attack, or mixed; None takes them in turn with the seed.

    Raises:
        PolicyError: an unknown composition.
    """
    if isinstance(composition, int) and not isinstance(composition, bool) and 0 <= composition < len(COMPOSITIONS):
        composition = COMPOSITIONS[composition]
    if composition is not None and composition not in COMPOSITIONS:
        raise PolicyError(f"composition is {composition!r}; give one of {', '.join(COMPOSITIONS)}, 0..2, or nothing")
    return Hidden(composition)


def composition_of(game: int) -> str:
    """The hidden opponent's team in a game of a series.

    Raises:
        PolicyError: not a whole number from 0.
    """
    if isinstance(game, bool) or not isinstance(game, (int, np.integer)) or game < 0:
        raise PolicyError(f"game is {game!r}; give the number of the game, from 0")
    return COMPOSITIONS[int(game) % len(COMPOSITIONS)]


def default_roles(team_size: int) -> list[str]:
    """A third of the boats (rounded) defend: 1 attacks, 1 + 1, 2 + 1, 3 + 1, 3 + 2, ..."""
    defenders = round(team_size / 3)
    return ["attack"] * (team_size - defenders) + ["defend"] * defenders


def fit(what: str, words: Sequence[str], team_size: int) -> Sequence[str]:
    """One word per boat.

    Raises:
        PolicyError: neither one word nor one per boat.
    """
    if len(words) == 1:
        return list(words) * team_size
    if len(words) != team_size:
        raise PolicyError(f"{what} names {len(words)} boats for a team of {team_size}; give one for all or one each")
    return words


def _words(what: str, given: str | Sequence[str], known: Sequence[str]) -> list[str]:
    parts = given.split(",") if isinstance(given, str) else list(given)
    words = [str(part).strip().lower() for part in parts]
    for word in words:
        if word not in known:
            raise PolicyError(f"{what} has {word!r}; choose from {', '.join(known)}")
    if not words:
        raise PolicyError(f"{what} is empty; choose from {', '.join(known)}")
    return words


def checked_points(points: Any) -> Array | None:
    """Waypoints as an array (k, 2) or (n_team, k, 2), m.

    Raises:
        PolicyError: wrong shape, empty, or not finite.
    """
    if points is None:
        return None
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise PolicyError(f"points are no (x, y) in m, or not equally many for all boats: {error}") from error
    if array.ndim not in (2, 3) or array.shape[-1] != 2 or array.size == 0 or not np.isfinite(array).all():
        raise PolicyError(f"points have shape {array.shape}; give finite (x, y) in m: (k, 2) or (boats, k, 2)")
    return array


def checked_reach(reach_m: Any) -> float:
    """A distance above 0, m.

    Raises:
        PolicyError: anything else.
    """
    if isinstance(reach_m, bool) or not isinstance(reach_m, (int, float)) or not 0 < reach_m < np.inf:
        raise PolicyError(f"reach_m is {reach_m!r}; give a distance in m above 0")
    return float(reach_m)


def checked_fraction(speed_fraction: Any) -> float:
    """A share of top speed in (0, 1].

    Raises:
        PolicyError: anything else.
    """
    if isinstance(speed_fraction, bool) or not isinstance(speed_fraction, (int, float)) or not 0 < speed_fraction <= 1:
        raise PolicyError(f"speed_fraction is {speed_fraction!r}; give a number above 0 and at most 1")
    return float(speed_fraction)
