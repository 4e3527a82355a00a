"""Reading of our own game."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numpy as np

from ..exceptions import FleetError
from ..fleet import Fleet
from ..jit import Array
from ..surroundings import Surroundings
from .driving import driven_boats
from .game_facts import GameFacts, facts_of_games, platforms_of
from .readers import game_reader

KEEP_OUT_MARGIN_M = 0.1
"""Distance kept beyond a flag's keep-out circle, because the game throws back boats that touch it."""


@game_reader(lambda env: hasattr(env, "core") and hasattr(env, "command_filter"))
class MctfReader:
    """Reader of an `MctfEnv`: exact state with the autopilots' memory; commands are filtered inside its step."""

    takes_pairs_only = False

    def __init__(self, env: Any) -> None:
        self.env = env
        self.agent_ids: tuple[str, ...] = tuple(env.possible_agents)
        self._platforms = platforms_of(env.core)

    def facts(self) -> GameFacts:
        """Return step and sizes."""
        return facts_of_games(self.env.core)

    @contextmanager
    def filtering(self, safe: Callable[[Array], Array]) -> Iterator[None]:
        """While inside, commands (n, 2) pass ``safe`` after every other decider; the env is restored after."""

        def command_filter(core: Any, commands: Array) -> Array:
            if len(commands) != 1:
                raise FleetError("this wrapper shields one game; use BatchedShield for a batch")
            return safe(commands[0])[np.newaxis]

        with self.env.filtered(command_filter):
            yield

    def check_answers(self, agent_ids: Sequence[str]) -> None:
        """Accept all answers: the game plays actions of any kind."""

    def moment(self) -> float:
        """Return the game's time, s."""
        return float(self.env.core.time_s[0])

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """Return all boats.

        The shield controls game-controlled boats only with ``shield_autopilot``, and disabled ones never.
        """
        core = self.env.core
        controlled = (core.team == team) & ~core.is_disabled[0]
        if not shield_autopilot:
            driven = core.is_tagged[0] | core.oob[0]
            if core.config.n_obstacles > 0:  # only core.driven, of the last step, holds boats that hit obstacles
                driven = driven | core.driven[0]
            controlled = controlled & ~driven
        rows = driven_boats(core)
        return Fleet(
            core.state[0].copy(),  # copied, because decisions are read after the step has moved the boats
            core.team,
            self._platforms,
            controlled,
            self.agent_ids,
            driven=None if rows is None else rows[0],
            visiting=~core.on_side[0],
        )

    def commands(self, actions: Mapping[str, Any]) -> Array:
        """Return the commands of actions of any kind that the env understands."""
        return np.asarray(self.env.decode(actions))

    def playable(self, actions: Mapping[str, Any]) -> dict[str, Any]:
        """Return the actions unchanged: the env accepts all kinds."""
        return dict(actions)

    def surroundings(self, team: int, keep_out: bool) -> Surroundings:
        """Return field edge, obstacles and the own flag's circle."""
        return surroundings_of(self.env.core, team, keep_out)


def surroundings_of(core: Any, team: int, keep_out: bool = True) -> Surroundings:
    """Return the static obstacles of a `BatchedMctf`, its field edge included.

    With ``keep_out`` the own flag's circle is one. It counts while the flag is away too: the flag may come home at any
    time, and the game then throws out boats inside. A game with ``flag_keepout_m`` 0 throws nobody out and has no
    circle.
    """
    config, obstacles = core.config, core.config.obstacles or {}
    circles = tuple((float(x), float(y), float(r)) for r, (x, y) in obstacles.get("circle") or ())
    polygons = tuple(tuple((float(x), float(y)) for x, y in corners) for corners in obstacles.get("polygon") or ())
    keepout_m = config.flag_keepout_m if keep_out else 0.0
    return surroundings(core.field.size, circles, polygons, core.flag_home[team], keepout_m, config.agent_radius_m)


def surroundings(
    size: Any, circles: tuple[Any, ...], polygons: tuple[Any, ...], flag: Any, keepout_m: float, radius_m: Any
) -> Surroundings:
    """Return field edge of size (2,), m, obstacles, and the keep-out circle round the flag (``keepout_m`` 0: none)."""
    circle: tuple[Any, ...] = ()
    if keepout_m > 0.0:
        reach_m = float(keepout_m) + float(np.max(radius_m)) + KEEP_OUT_MARGIN_M
        circle = ((float(flag[0]), float(flag[1]), reach_m),)
    return _surroundings((0.0, 0.0, float(size[0]), float(size[1])), circles, polygons, circle)


@lru_cache(maxsize=64)
def _surroundings(edge: Any, circles: tuple[Any, ...], polygons: tuple[Any, ...], stops: Any) -> Surroundings:
    return Surroundings(edge, circles, polygons, stops=stops)
