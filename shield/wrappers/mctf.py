"""Reading our own game."""

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
from .game_facts import GameFacts, facts_of_games
from .reading import KEEP_OUT_MARGIN_M, obstacles_of


class MctfReader:
    """Reads an `MctfEnv`: exact state with the autopilots' memory, commands inside its step."""

    takes_pairs_only = False

    def __init__(self, env: Any) -> None:
        self.env = env
        self.agent_ids: tuple[str, ...] = tuple(env.possible_agents)
        config = env.config
        kinds = config.platforms
        self._platforms = tuple(kinds) if isinstance(kinds, (tuple, list)) else (kinds,) * len(self.agent_ids)

    def facts(self) -> GameFacts:
        """Step and sizes."""
        return facts_of_games(self.env.core)

    @contextmanager
    def filtering(self, safe: Callable[[Array], Array]) -> Iterator[None]:
        """While inside, commands (n, 2) pass ``safe`` after the last decider; afterwards the game is as it was."""

        def command_filter(core: Any, commands: Array) -> Array:
            if len(commands) != 1:
                raise FleetError("this wrapper shields one game; use BatchedShield for a batch")
            return safe(commands[0])[np.newaxis]

        with self.env.filtered(command_filter):
            yield

    def check_answers(self, agent_ids: Sequence[str]) -> None:
        """The game plays one command a step, of any kind."""

    def moment(self) -> float:
        """Time of the game, s."""
        return float(self.env.core.time_s[0])

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """All boats now; boats the game drives are controlled only with ``shield_autopilot``, disabled ones never."""
        core = self.env.core
        controlled = (core.team == team) & ~core.is_disabled[0]
        if not shield_autopilot:
            driven = core.is_tagged[0] | core.oob[0]
            if core.config.n_obstacles > 0:  # who hits obstacles is in it only; between steps it is of the last
                driven = driven | core.driven[0]
            controlled = controlled & ~driven
        # a copy: decisions are read after the step has moved the boats
        state, driven = core.state[0].copy(), driven_boats(core)
        return Fleet(
            state,
            core.team,
            self._platforms,
            controlled,
            self.agent_ids,
            driven=None if driven is None else driven[0],
            visiting=~core.on_side[0],
        )

    def commands(self, actions: Mapping[str, Any]) -> Array:
        """Commands of actions of any kind the env understands."""
        decoded: Array = self.env.decode(actions)
        return decoded

    def playable(self, actions: Mapping[str, Any]) -> dict[str, Any]:
        """The actions: the env takes all that there are."""
        return dict(actions)

    def surroundings(self, team: int, keep_out: bool) -> Surroundings:
        """Field edge, obstacles and the own flag's circle."""
        return surroundings_of(self.env.core, team, keep_out)


def surroundings_of(core: Any, team: int, keep_out: bool = True) -> Surroundings:
    """Static constraints of a `BatchedMctf`: field edge, obstacles and, with ``keep_out``, the own flag's circle.

    It counts while the flag is away as well: the game throws out who is inside when the flag comes home, at any time.
    A game with ``flag_keepout_m`` 0 throws nobody out, and has no circle.
    """
    kept = keep_out and core.config.flag_keepout_m > 0.0
    return _surroundings(core.config, core.field.size, tuple(core.flag_home[team]), kept)


@lru_cache(maxsize=64)
def _surroundings_cached(
    size: tuple[float, float], circles: tuple[Any, ...], polygons: tuple[Any, ...], keep_out: tuple[Any, ...]
) -> Surroundings:
    return Surroundings((0.0, 0.0, size[0], size[1]), circles, polygons, stops=keep_out)


def _surroundings(config: Any, size: Any, flag: tuple[float, float], keep_out: bool) -> Surroundings:
    circles, polygons = obstacles_of(config.obstacles)
    radius = config.agent_radius_m
    widest = max(radius) if isinstance(radius, (tuple, list)) else radius
    circle = ((float(flag[0]), float(flag[1]), float(config.flag_keepout_m + widest + KEEP_OUT_MARGIN_M)),)
    return _surroundings_cached(
        (float(size[0]), float(size[1])), tuple(circles), tuple(polygons), circle if keep_out else ()
    )
