"""What a shield relies on of a game: its step, and how near boats may come before it counts a collision."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ..config import ShieldConfig, Unsaid
from ..exceptions import ConfigError
from ..jit import Array, IntArray
from ..platforms import Platform, get_platform

logger = logging.getLogger(__name__)


class GameFacts(NamedTuple):
    """Attributes of a game.

    Attributes:
        dt_s: time the boats are moved by for one command, s.
        radius_m: (n,) radius of each boat, m; two boats collide when no farther apart than the sum.
        team: (n,) team of each boat.
        obstacles: whether there are any, which boats hit by their radius.
        decision_s: time that the boats are moved by for one answer of a policy, s; 0: the same.
    """

    dt_s: float
    radius_m: Array
    team: IntArray
    obstacles: bool
    decision_s: float = 0.0

    @property
    def moves(self) -> int:
        """Moves of the boats for one answer of a policy."""
        return max(1, round(self.decision_s / self.dt_s))

    def collision_m(self, team: int | None = None) -> float:
        """Largest distance at which a boat of the team (None: any boat) collides with another, m; 0 where none can."""
        ours = np.ones(len(self.team), bool) if team is None else self.team == team
        pairs = ours[:, None] & ~np.eye(len(ours), dtype=bool)
        return float((self.radius_m[:, None] + self.radius_m)[pairs].max(initial=0.0))

    def obstacle_clearance_m(self, team: int | None = None) -> float:
        """Largest distance at which a boat of the team hits an obstacle, m; 0 where there is none."""
        ours = np.ones(len(self.team), bool) if team is None else self.team == team
        return float(self.radius_m[ours].max(initial=0.0)) if self.obstacles else 0.0

    def settings(self) -> dict[str, float]:
        """Settings of a shield for this game, by name."""
        distances = {"separation_m": self.collision_m(), "obstacle_clearance_m": self.obstacle_clearance_m()}
        return {"dt_s": self.dt_s, **{name: metres for name, metres in distances.items() if metres > 0.0}}


def facts_of_games(core: Any) -> GameFacts:
    """Facts of a `BatchedMctf`."""
    config = core.config
    return GameFacts(
        float(config.dt_s), core.agent_radius_m, core.team, config.n_obstacles > 0, float(config.decision_s)
    )


def check_step(config: ShieldConfig, facts: GameFacts) -> None:
    """Refuse a game of another step than the shield's, which would foresee boats elsewhere than they go.

    Raises:
        ConfigError: it is one.
    """
    if config.moves > 1:
        raise ConfigError(
            f"the shield decides once for {config.moves} moves of the boats (move_s), but is asked here before each; "
            f"build it by Shield.for_game(game), or with dt_s={facts.dt_s:g}"
        )
    if not math.isclose(config.dt_s, facts.dt_s, rel_tol=1e-9):
        raise ConfigError(
            f"the shield decides for steps of {config.dt_s:g} s (dt_s), but the game moves its boats by {facts.dt_s:g} "
            f"s for each command; build it by Shield.for_game(game), or with dt_s={facts.dt_s:g}"
        )


def for_held_commands(config: ShieldConfig, facts: GameFacts) -> ShieldConfig:
    """The settings of a shield that decides once for all moves that the game makes of one answer of a policy.

    A shield for the moves themselves, as `Shield.for_game` builds it, is meant for such a game; so is one already made
    for it.

    Raises:
        ConfigError: it is for moves of another length, or another number of them.
    """
    decision_s = facts.moves * facts.dt_s
    given = config.moves > 1 or facts.moves == 1
    if not math.isclose(config.model_s, facts.dt_s, rel_tol=1e-9) or (given and config.moves != facts.moves):
        steps = "" if config.moves == 1 else f", {config.moves} of them a command"
        raise ConfigError(
            f"the shield foresees moves of {config.model_s:g} s{steps}, but the game moves its boats {facts.moves} "
            f"time(s) by {facts.dt_s:g} s for each command; build it by Shield.for_game(game), or with "
            f"dt_s={facts.dt_s:g}"
        )
    return config if given else replace(config, dt_s=decision_s, move_s=facts.dt_s)


def with_distances(config: ShieldConfig, facts: GameFacts, team: int) -> ShieldConfig:
    """The settings, with the game's distances where nobody chose one and the game's is larger; the log says so, once.

    A larger distance than the default is what a shield round this game is for. A smaller one than the game's that was
    chosen stays: it may be meant, as where hits are counted at two radii.
    """
    larger: dict[str, Any] = {}
    for name, metres, why in _distances(facts, team):
        if not config.said(name) and metres > getattr(config, name):
            larger[name] = Unsaid(metres)
            _log_once(
                logging.WARNING,
                f"no {name} was given: the shield keeps {metres:g} m, the distance at which this game {why}",
            )
    return replace(config, **larger) if larger else config


def warn_of_distances(config: ShieldConfig, facts: GameFacts, team: int | None) -> None:
    """Log, once, that a shield keeps less than the distances of its game."""
    for name, metres, why in _distances(facts, team):
        kept_m = getattr(config, name)
        if kept_m < metres - 1e-9:
            _log_once(
                logging.WARNING,
                f"the shield keeps {kept_m:g} m ({name}), but this game {why} at {metres:g} m: such hits it does not "
                f"prevent; build it by Shield.for_game(game) or games_shield(core), or give {name}={metres:g}",
            )


def _distances(facts: GameFacts, team: int | None) -> tuple[tuple[str, float, str], ...]:
    return (
        ("separation_m", facts.collision_m(team), "counts collisions"),
        ("obstacle_clearance_m", facts.obstacle_clearance_m(team), "has boats hit its obstacles"),
    )


@lru_cache(maxsize=256)
def _log_once(level: int, words: str) -> None:
    logger.log(level, words)


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
