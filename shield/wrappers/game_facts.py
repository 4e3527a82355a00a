"""The settings of a game that a shield relies on: its step, and the distances at which it counts collisions."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ..arrays import NoNumbersError, numbers
from ..config import DefaultDistance, ShieldConfig
from ..exceptions import ConfigError
from ..jit import Array, IntArray
from ..platforms import Platform, get_platform

logger = logging.getLogger(__name__)

_WHY = {"separation_m": "counts collisions", "obstacle_clearance_m": "has boats hit its obstacles"}


class GameFacts(NamedTuple):
    """Settings of a game that a shield relies on.

    Attributes:
        dt_s: length of a substep, in which the boats move under one command, s.
        radius_m: (n,) radius of each boat, m; two boats collide when no farther apart than the sum; 0: never.
        team: (n,) team number of each boat, 0 (blue) or 1 (red).
        obstacles: whether the game has obstacles, which a boat hits by its radius.
        decision_s: time that the boats move for one action of a policy, s; 0: the same as ``dt_s``.
    """

    dt_s: float
    radius_m: Array
    team: IntArray
    obstacles: bool
    decision_s: float = 0.0

    @property
    def moves(self) -> int:
        """Number of substeps for one action of a policy."""
        return max(1, round(self.decision_s / self.dt_s))

    def faults(self, boats: int) -> str:
        """Return what is wrong with these settings of so many boats, and the remedy; empty: nothing."""
        for name in ("radius_m", "team"):
            shape = np.shape(getattr(self, name))
            if shape != (boats,):
                return f"{name} has shape {shape}; give one entry for each of the {boats} boats of agent_ids"
        for name, values, least in (("dt_s", self.dt_s, 1e-6), ("radius_m", self.radius_m, 0.0)):
            if not _are_numbers(values, least):
                return f"{name} is {_plain(values)!r}; give finite numbers of at least {least:g}"
        if not _are_numbers(self.decision_s, 0.0):
            return f"decision_s is {self.decision_s!r}; give s, or 0 where it is dt_s"
        if not np.isin(self.team, (0, 1)).all():
            return f"team is {_plain(self.team)}; number the teams 0 and 1"
        return ""

    def distances(self, team: int | None = None) -> dict[str, float]:
        """Return the distances, m, at which boats collide with each other and with obstacles; 0: never.

        Each is the largest over the boats of the team (None: of both teams).
        """
        radius_m, teams = np.asarray(self.radius_m, dtype=np.float64), np.asarray(self.team)
        ours = np.ones(len(teams), bool) if team is None else teams == team
        pairs = ours[:, None] & ~np.eye(len(ours), dtype=bool)
        collision_m = float((radius_m[:, None] + radius_m)[pairs].max(initial=0.0))
        clearance_m = float(radius_m[ours].max(initial=0.0)) if self.obstacles else 0.0
        return {"separation_m": collision_m, "obstacle_clearance_m": clearance_m}

    def settings(self) -> dict[str, float]:
        """Return the settings of a shield for this game, by name."""
        return {"dt_s": self.dt_s, **{name: metres for name, metres in self.distances().items() if metres > 0.0}}


def _are_numbers(values: Any, least: float) -> bool:
    try:
        return bool((np.isfinite(numbers(values)) & (numbers(values) >= least)).all())
    except NoNumbersError:
        return False


def _plain(values: Any) -> Any:
    return values.tolist() if isinstance(values, np.ndarray) else values


def facts_of_games(core: Any) -> GameFacts:
    """Return the settings of a `BatchedMctf`."""
    config = core.config
    return GameFacts(
        float(config.dt_s), core.agent_radius_m, core.team, config.n_obstacles > 0, float(config.decision_s)
    )


def fitting(config: ShieldConfig, facts: GameFacts, team: int, held: bool = False) -> ShieldConfig:
    """Return a shield's settings fitted to a game.

    The game's distances replace smaller ones that the user did not choose; the log says so. A smaller distance that the
    user chose stays, since it may be meant; the log warns of it.

    Args:
        config: a shield's settings.
        facts: the game.
        team: the team to shield.
        held: the shield decides once for all substeps of an action; otherwise before each substep.

    Raises:
        ConfigError: the settings are for another step or another number of substeps.
    """
    config = _for_held_commands(config, facts) if held and facts.moves > 1 else _for_moves(config, facts)
    larger: dict[str, Any] = {}
    for name, metres in facts.distances(team).items():
        if not config.is_chosen(name) and metres > getattr(config, name):
            larger[name] = DefaultDistance(metres)
            _warn_once(
                f"no {name} was given: the shield keeps {metres:g} m, the distance at which this game {_WHY[name]}"
            )
    config = replace(config, **larger) if larger else config
    warn_of_distances(config, facts, team)
    return config


def _for_moves(config: ShieldConfig, facts: GameFacts) -> ShieldConfig:
    """Return the settings if they are for a decision before each substep; otherwise predictions would be wrong."""
    remedy = f"build it by Shield.for_game(game), or with dt_s={facts.dt_s:g}"
    if config.moves > 1:
        raise ConfigError(
            f"the shield decides once for {config.moves} moves of the boats (move_s), but is asked here before each; "
            + remedy
        )
    if not math.isclose(config.dt_s, facts.dt_s, rel_tol=1e-9):
        raise ConfigError(
            f"the shield decides for steps of {config.dt_s:g} s (dt_s), but the game moves its boats by {facts.dt_s:g} "
            f"s for each command; {remedy}"
        )
    return config


def _for_held_commands(config: ShieldConfig, facts: GameFacts) -> ShieldConfig:
    """Return settings for one decision per action, from those for single substeps or already of this form."""
    given = config.moves > 1
    if not math.isclose(config.model_s, facts.dt_s, rel_tol=1e-9) or (given and config.moves != facts.moves):
        steps = f", {config.moves} of them a command" if given else ""
        raise ConfigError(
            f"the shield predicts moves of {config.model_s:g} s{steps}, but the game moves its boats {facts.moves} "
            f"time(s) by {facts.dt_s:g} s for each command; build it by Shield.for_game(game), or with "
            f"dt_s={facts.dt_s:g}"
        )
    return config if given else replace(config, dt_s=facts.moves * facts.dt_s, move_s=facts.dt_s)


def warn_of_distances(config: ShieldConfig, facts: GameFacts, team: int | None) -> None:
    """Log, once, that a shield's distances are smaller than those of its game."""
    for name, metres in facts.distances(team).items():
        if getattr(config, name) < metres - 1e-9:
            _warn_once(
                f"the shield keeps {getattr(config, name):g} m ({name}), but this game {_WHY[name]} at {metres:g} m: "
                f"such hits it does not prevent; build it by Shield.for_game(game) or games_shield(core), or give "
                f"{name}={metres:g}"
            )


@lru_cache(maxsize=256)
def _warn_once(words: str) -> None:
    logger.warning(words)


def platforms_of(core: Any) -> tuple[str | Platform, ...]:
    """Return the platforms of the boats of a `BatchedMctf`."""
    kinds = core.config.platforms
    return tuple(kinds) if isinstance(kinds, (tuple, list)) else (kinds,) * core.n_boats


def check_same_games(
    core: Any, games: int, platforms: Sequence[str | Platform], team: Sequence[int], dt_s: float
) -> None:
    """Refuse games with other boats, teams, steps or numbers of games than the shield was built for."""
    ours, theirs = (tuple(map(get_platform, kinds)) for kinds in (platforms, platforms_of(core)))
    for what, mine, others in (
        ("boats", ours, theirs),
        ("teams", tuple(map(int, team)), tuple(map(int, core.team))),
        ("number of games", (games,), (core.n_games,)),
        ("step, s,", (dt_s,), (core.config.dt_s,)),
    ):
        if mine != others:
            built, has = (", ".join(str(getattr(one, "name", one)) for one in values) for values in (mine, others))
            raise ConfigError(
                f"the shield was built for {what} {built}, the games have {has}; build the shield of these games with "
                "games_shield(core, config, team)"
            )
