"""Whether a shield was built for just these games."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .exceptions import ConfigError
from .platforms import Platform, get_platform

REMEDY = "build the shield of these games with games_shield(core, config, team)"


def platforms_of(core: Any) -> tuple[str | Platform, ...]:
    """Platforms of the boats of a `BatchedMctf`."""
    kinds = core.config.platforms
    return tuple(kinds) if isinstance(kinds, (tuple, list)) else (kinds,) * core.n_boats


def check_same_games(
    core: Any, games: int, platforms: Sequence[str | Platform], team: Sequence[int], dt_s: float
) -> None:
    """Refuse games that a shield was not built for: it would foresee other boats than are there, or other steps.

    Args:
        core: the `BatchedMctf`.
        games: number of games the shield decides for.
        platforms: platforms of its boats.
        team: their teams.
        dt_s: step of its decisions, s.

    Raises:
        ConfigError: the games are not these.
    """
    ours, theirs = _names(platforms), _names(platforms_of(core))
    for what, mine, others in (
        ("boats", ours, theirs),
        ("teams", [int(one) for one in team], [int(one) for one in core.team]),
        ("number of games", games, core.n_games),
        ("step, s,", dt_s, core.config.dt_s),
    ):
        if mine != others:
            raise ConfigError(
                f"the shield was built for {what} {_words(mine)}, the games have {_words(others)}; {REMEDY}"
            )


def _names(platforms: Sequence[str | Platform]) -> list[Platform]:
    return [get_platform(one) if isinstance(one, str) else one for one in platforms]


def _words(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(one.name if isinstance(one, Platform) else str(one) for one in value)
    return str(value)
